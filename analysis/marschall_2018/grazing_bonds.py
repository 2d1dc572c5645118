"""Effect of grazing bonds on contact numbers and bands: compare Secs. III C and III D of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/grazing_bonds.py samples/modes.csv

The table is that of sample_tables.py. A bond grazes if it bears less than 1e-6 of the mean force of a bond, as where a
rod slid until it met another one. Each takes one mode out of the low band into the high one and adds 2/N' to z, with
N' particles that are no rattlers; here both are undone. Prints a row for each folder of modes, aspect ratio and energy
density, with standard errors. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import csv
import sys
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

from jamshape.command import parser_of, report, run
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.mode_tables import BY_GRAZING

NEEDED = ("file", "alpha", "u0", "z", "n_backbone", "n_grazing", "low", "middle", "high")


class Counts(NamedTuple):
    """Contacts and bands of one packing, as they are and without bonds that graze."""

    z: float
    z_without: float
    low: float
    low_without: float
    high: float
    high_without: float


def counts_of(row: dict[str, str]) -> Counts:
    """Count with and without bonds that graze; bands are fractions of all modes but translations.

    They are NaN of a packing whose bands are not apart.
    """
    z, backbone, grazing, low, middle, high = (float(row[name] or "nan") for name in NEEDED[3:])
    modes = low + middle + high
    return Counts(
        *(z, z - 2 * grazing / backbone),
        *(low / modes, (low + BY_GRAZING["low"] * grazing) / modes),
        *(high / modes, (high + BY_GRAZING["high"] * grazing) / modes),
    )


Key = tuple[str, float, float]
"""The folder of the modes, since packings led to other energies come back to their own; alpha and u0."""


def read(path: Path) -> dict[Key, list[Counts]]:
    """Read a table, by folder, aspect ratio and energy density.

    Raises
    ------
    ValueError
        If it is not a table of modes, or empty.
    """
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows or (missing := [name for name in NEEDED if name not in rows[0]]):
        found = f"no {missing[0]}" if rows else "no row"
        msg = f"{path} has {found}, expected modes.csv of sample_tables.py with packings that have an alpha"
        raise ValueError(msg)
    found_of: dict[Key, list[Counts]] = {}
    for row in rows:
        key = (Path(row["file"]).parent.name, float(row["alpha"]), float(row["u0"]))
        found_of.setdefault(key, []).append(counts_of(row))
    return dict(sorted(found_of.items()))


def text(one: Mean) -> str:
    """Write a mean with its error, if there is one."""
    return f"{one.value:.5f}" + (f" +- {one.error:.5f}" if one.samples > 1 else "")


def main(options: Namespace) -> None:
    """Read, average, print, report."""
    averages = {
        key: {name: mean([getattr(one, name) for one in every]) for name in Counts._fields}
        for key, every in read(options.table).items()
    }
    print(f"| folder | alpha | u0 | samples | {' | '.join(Counts._fields)} |")
    print(f"|{' --- |' * (4 + len(Counts._fields))}")
    for (folder, alpha, u0), means in averages.items():
        cells = " | ".join(text(one) for one in means.values())
        print(f"| {folder} | {alpha:g} | {u0:g} | {means['z'].samples} | {cells} |")
    told = [
        {"folder": folder, "alpha": alpha, "u0": u0}
        | {name: one._asdict() for name, one in means.items()}
        for (folder, alpha, u0), means in averages.items()
    ]
    report({"rows": told})


if __name__ == "__main__":
    parser = parser_of(__doc__)
    parser.add_argument("table", type=Path, metavar="TABLE", help="modes.csv")
    run(parser, main)
