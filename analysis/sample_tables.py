"""Write what packings, modes and runs of a reproduced paper are as tables, a line for each of their files.

    python analysis/sample_tables.py FOLDER --out FOLDER/samples

FOLDER is what `jamshape reproduce` makes. Writes packings.csv, modes.csv and runs.csv to the folder --out. They are what
averages in figures are of, without the coordinates: seeds, sizes, how each one ended, and what was measured. A cell is
empty where a file has no such number. Units are those of the files: the diameter and the stiffness k of the smaller
particles (docs/explanation/files.md). The commands that made the files are in jobs.csv, and the versions in
versions.csv, which agreement.py writes. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import csv
import math
from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from jamshape.command import parser_of, report, run
from jamshape.files.h5md import read_attributes
from jamshape.files.sets import OTHERS
from jamshape.measures.runs import rate_of
from jamshape.vibration.sets import TOLD, of_packing
from jamshape.vibration.table import read_modes

SHAPE = ("alpha", "exponent", "w1", "w2", "size_ratio", "n", "seed")
PACKING = (
    *SHAPE, "way", "protocol", "phi_thermal", "n_sweeps", "u0", "u", "pressure", "phi", "phi_J", "z", "z_single",
    "n_rattlers", "n_bonds", "S2", "S4", "C4", "residual_force", "residual_torque", "outcome", "wall_seconds",
)  # fmt: skip
RUN = (
    *SHAPE, "kappa", "phi_start", "phi_end", "method", "phi_unjams", "phi_jams", "frames_minimised",
    "flow_steps", "flow_evaluations", "flow_wall_seconds",
)  # fmt: skip
MODES = (
    *SHAPE, "u0", "n_backbone", "n_modes", "n_bonds", "z", "rank", "n_self_stress", "n_grazing",
    *TOLD, "negative", "bulk_modulus", "pure_shear_modulus", "wall_seconds",
)  # fmt: skip


def told_run(path: Path) -> dict[str, Any] | None:
    """Read what a run is, and its rate at the end; None of one that was not finished."""
    found = read_attributes(path)
    return found | {"kappa": rate_of(found)} if found.get("finished") else None


def told_modes(path: Path) -> dict[str, Any]:
    """Read what modes are: numbers of their own before those of the packing, and how many are in each band."""
    table = read_modes(path)
    counts = {band: len(table.in_band(band)) for band in TOLD}
    counts["negative"] = int((table["sign"] < 0).sum())
    return of_packing(table) | table.attributes | counts


def rows_of(
    paths: Iterable[Path], read: Callable[[Path], dict[str, Any] | None]
) -> list[dict[str, Any]]:
    """Read files, but those of which nothing can be told yet."""
    rows = ((path, read(path)) for path in sorted(paths))
    return [row | {"path": path} for path, row in rows if row]


def write(path: Path, columns: Sequence[str], rows: Sequence[dict[str, Any]], folder: Path) -> None:
    """Write a table; columns that no line has are left out."""
    known = [name for name in columns if any(name in row for row in rows)]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("file", *known))
        for row in rows:
            name = row["path"].relative_to(folder).as_posix()
            writer.writerow((name, *(short(row.get(name)) for name in known)))


def short(value: Any) -> str:
    """Write a number to ten digits, and nothing for what is not known."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def main(options: Namespace) -> None:
    """Read, write, report."""
    folder = options.folder
    if not (folder / "packings").is_dir():
        msg = f"{folder} has no folder packings, expected one that jamshape reproduce made"
        raise ValueError(msg)
    options.out.mkdir(parents=True, exist_ok=True)
    places = [p for part in ("packings", "ladder") for p in folder.glob(f"{part}/*/*.h5")]
    packings = [place for place in places if not place.name.endswith(OTHERS)]
    tables = {
        "packings": (PACKING, rows_of(packings, read_attributes)),
        "modes": (MODES, rows_of(folder.glob("modes/*/*.modes.h5"), told_modes)),
        "runs": (RUN, rows_of(folder.glob("runs/*.h5"), told_run)),
    }  # fmt: skip
    for name, (columns, rows) in tables.items():
        write(options.out / f"{name}.csv", columns, rows, folder)
    report({"out": options.out, **{name: len(rows) for name, (_, rows) in tables.items()}})


if __name__ == "__main__":
    parser = parser_of(__doc__, "samples")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of jamshape reproduce")
    run(parser, main)
