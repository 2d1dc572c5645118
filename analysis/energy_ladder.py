"""Lead packings to other energies: for Figs. 14, 18 and 20 of Marschall & Teitel, PRE 97, 012905.

    python analysis/energy_ladder.py PACKING.h5 [MORE.h5 ...] --u0 1e-18 1e-15 1e-12 1e-9 --out LADDER

Every packing is led from its own energy up and down to each u0 and written to LADDER. Started again
after a kill it goes on: files that are there are not made again. The last line of standard output is
one JSON object; the exit code is 0 only if every file is there and forces balance in each.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from common.ladder import Rung, climb
from jamshape.command import parser_of, report, run
from jamshape.files.h5md import read_attributes
from jamshape.files.outcomes import shortfall
from jamshape.files.sets import PackingFile
from jamshape.minima.target import Target

SUMMARY = ("u0", "seed", "outcome", "phi", "phi_J", "residual", "z", "contacts_shared")


def parser() -> ArgumentParser:
    """Describe the command line."""
    usual = Target()
    found = parser_of(__doc__)
    found.add_argument("packings", type=Path, nargs="+", metavar="PACKING", help="H5MD files")
    energies = "energy densities U/L^D, in any order"
    found.add_argument("--u0", type=float, nargs="+", required=True, help=energies)
    close, largest = (
        "of |u - u0|/u0 (%(default)s)",
        "largest net force and torque over the mean bond force",
    )
    found.add_argument("--accuracy", type=float, default=usual.accuracy, help=close)
    found.add_argument(
        "--tolerance", type=float, default=usual.tolerance, help=f"{largest} (%(default)s)"
    )
    found.add_argument("--out", type=Path, required=True, help="folder")
    return found


def row_of(rung: Rung) -> dict[str, Any]:
    """Summarise one rung."""
    if rung.failure:
        return {"out": rung.path, "u0": rung.u0, "failure": rung.failure}
    file = PackingFile.read(rung.path)
    stored = {name: file.attributes[name] for name in SUMMARY if name in file.attributes}
    told = {"out": rung.path, "made": rung.made, "reached": file.reached}
    return told | file.system().report() | stored


def main(options: Namespace) -> int:
    """Climb all ladders; return the exit code."""
    target = Target(options.u0[0], options.accuracy, options.tolerance)
    for source in options.packings:
        if not source.is_file():
            msg = f"{source} does not exist, expected a packing of make_packing.py"
            raise ValueError(msg)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    total = len(options.packings) * len(set(options.u0))
    with tqdm(total=total, unit="packing") as bar:
        for source in options.packings:
            for rung in climb(source, options.u0, options.out, target):
                rows.append(row_of(rung))
                bar.set_postfix_str(rung.path.name, refresh=False)
                bar.update()
                if said := rung.failure or shortfall(read_attributes(rung.path)):
                    tqdm.write(f"{rung.path.name}: {said}", file=sys.stderr)
    failed = sum("failure" in found for found in rows)
    reached = sum(found.get("reached", False) for found in rows)
    made = sum(found.get("made", False) for found in rows)
    report({"made": made, "reached": reached, "failed": failed, "ladder": rows})
    return 0 if reached == len(rows) else 1


if __name__ == "__main__":
    run(parser(), main)
