"""Contact numbers against the smallest force that counts: what a bond is in Sec. III C of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/force_gap.py SWEEP [MORE.h5 ...] --least 1e-8 1e-7 1e-6 1e-5 1e-4 1e-3

Long rods slide along each other until they meet a third one, and rest on it with almost no force. Between the forces of
such bonds and those of the network that bears the load there is a gap, in which z does not depend on the smallest force
that counts. Prints for each aspect ratio z of all bonds, and of those that bear at least these fractions of the
mean force, with standard errors. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from jamshape.command import parser_of, report, run
from jamshape.contacts import coordination, find_contacts
from jamshape.files.ensembles import PackingFile

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.ensembles import conditions, curves_over, read_groups

LEAST = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3]


def z_of(file: PackingFile, least: list[float]) -> list[float]:
    """Count all bonds per particle, and those with at least each of these fractions of the mean force."""
    packing = file.packing()
    network = find_contacts(packing)
    return [coordination(packing, network, below).z_bearing for below in (0.0, *least)]


def main(options: Namespace) -> None:
    """Count and print."""
    groups = read_groups(options.files, needs=["alpha"], same=("n", "size_ratio", "u0"))
    rows = []
    print("| alpha | samples | all bonds |", " | ".join(f"{f:g}" for f in options.least), "|")
    print("| --- " * (3 + len(options.least)) + "|")
    for curve in curves_over(groups, "alpha").values():
        for alpha, files in curve.items():
            counted = zip(*(z_of(file, options.least) for file in files), strict=True)
            z = [mean(list(of)) for of in counted]
            print(f"| {alpha:g} | {len(files)} |", " | ".join(one.text() for one in z), "|")
            rows.append({"alpha": alpha, "samples": len(files), "z": z})
    report({"conditions": conditions(groups), "least": [0.0, *options.least], "rows": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, files="SWEEP")
    least = "smallest forces over the mean force (%(default)s)"
    parser.add_argument("--least", type=float, nargs="+", default=LEAST, help=least)
    run(parser, main)
