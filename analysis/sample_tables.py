"""Write tables of the packings, modes and runs of a reproduced paper, one line per file.

    python analysis/sample_tables.py FOLDER --out FOLDER/samples
    python analysis/sample_tables.py FOLDER --known TABLES --out FOLDER/samples

FOLDER is what `jamshape reproduce` makes. Writes to the folder --out a table for each folder of packings (rods.csv of
packings/rods, ordered.csv of packings/ordered1, packings/ordered2 and so on), ladder.csv of those that were led to
other energies, modes.csv, runs.csv, shears.csv, and series.csv of packings at several pressures. They are what averages
in figures are of, without the coordinates: seeds, sizes, how each one ended, and what was measured. Figures that need no coordinates are drawn from a table of packings as from
their folder. A cell is empty where a file has no such number, and nan where there is none of such particles. --known names earlier tables, of another day or machine: their lines are kept, but for those of files
that are in FOLDER again. Units are those of the files: the diameter and the stiffness k of the smaller
particles (docs/explanation/files.md). The commands that made the files are in jobs.csv, and the versions in
versions.csv, which agreement.py writes. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import csv
import json
import math
from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from common.ensembles import OTHERS
from common.stressed import AT_PRESSURE, of_pressure, with_sure_slope
from jamshape.command import parser_of, report, run
from jamshape.files.h5md import read_attributes, read_style
from jamshape.files.outcomes import is_reached
from jamshape.measures.runs import onset_report
from jamshape.measures.shears import read_shear
from jamshape.vibration.ensembles import TOLD, count_of, of_packing
from jamshape.vibration.table import read_modes

SHAPE = ("alpha", "exponent", "w1", "w2", "size_ratio", "n", "seed")
STYLE = ("shape", "dimension")
PACKING = (
    *STYLE, *SHAPE, "aspect_ratio", "asphericity", "beta", "z_iso", "protocol", "phi_thermal", "n_sweeps", "u0", "u", "pressure", "phi", "phi_J", "z", "z_single",
    "z_bearing", "n_rattlers", "n_bonds", "S2", "S4", "C4", "residual_force", "residual_torque", "tolerance", "outcome", "wall_seconds",
)  # fmt: skip
RUN = (
    *SHAPE, "sides", "kappa", "phi_start", "phi_end", "method", "phi_J(kappa)", "phi_J(kappa)_error", "phi_unjams", "phi_jams", "frames_minimised",
    "frames_undecided", "flow_steps", "flow_evaluations", "flow_wall_seconds",
)  # fmt: skip
MODES = (
    *SHAPE, "u0", "n_backbone", "n_modes", "n_bonds", "z", "rank", "n_self_stress", "n_grazing",
    *TOLD, "negative", "bulk_modulus", "bulk_modulus_bound", "pure_shear_modulus", "pure_shear_modulus_bound",
    "wall_seconds",
)  # fmt: skip

STEADY = ("pressure", "sigma", "mu", "z", "S_2", "rotation")
SHEAR = (
    *SHAPE, "phi", "gdot", "flow", "integrator", "strain", "startup",
    *STEADY, *(f"{name}_error" for name in STEADY),
)  # fmt: skip


def told_packing(path: Path) -> dict[str, Any]:
    """Read what a packing is; nan is told, as of the order of discs, so that averages leave it out."""
    found = dict(zip(STYLE, read_style(path), strict=True)) | read_attributes(path)
    nan = {name: "nan" for name, x in found.items() if isinstance(x, float) and math.isnan(x)}
    return found | nan


def told_run(path: Path) -> dict[str, Any] | None:
    """Read what a run is, its rate at the end and the onset of its pressure; None of one that was not finished."""
    found = read_attributes(path)
    return found | onset_report(path) if found.get("finished") else None


def told_modes(path: Path) -> dict[str, Any]:
    """Read what modes are: numbers of their own before those of the packing, and how many are in each band."""
    table = read_modes(path)
    counts: dict[str, Any] = {band: count_of(table, band) for band in TOLD}
    counts["negative"] = int((table["sign"] < 0).sum())
    return of_packing(table) | table.attributes | counts


def told_shear(path: Path) -> dict[str, Any] | None:
    """Read a steady shear and its averages; None of one without a steady state."""
    of = read_shear(path)
    if not of.steady:
        return None
    means = {name: of.steady.averages.get(name) for name in STEADY}
    told = {name: mean.value for name, mean in means.items() if mean}
    told |= {f"{name}_error": mean.error for name, mean in means.items() if mean}
    own = {"seed": of.seed, "strain": of.strain[-1], "startup": of.steady.startup}
    return read_attributes(path) | of.ensemble.report() | own | told


def told_series(path: Path) -> dict[str, Any]:
    """Read a packing at several pressures, a column for each number at each of them."""
    rows = [with_sure_slope(row) for row in json.loads(path.read_text(encoding="utf-8"))]
    of_all = {name: rows[0][name] for name in ("alpha", "n", "seed")}
    at = {of_pressure(name, row): row.get(name) for name in AT_PRESSURE for row in rows}
    return of_all | at


def table_of(packing: Path, folder: Path) -> str:
    """Name the table that a packing is in."""
    part, group = packing.relative_to(folder).parts[:2]
    return group.rstrip("0123456789") if part == "packings" else part


def rows_of(
    paths: Iterable[Path], read: Callable[[Path], dict[str, Any] | None]
) -> list[dict[str, Any]]:
    """Read files, but those of which nothing can be told yet."""
    rows = ((path, read(path)) for path in sorted(paths))
    return [row | {"path": path} for path, row in rows if row]


def cells(row: dict[str, Any], columns: Sequence[str], folder: Path) -> dict[str, str]:
    """Write a line."""
    told = {name: short(row.get(name)) for name in columns}
    return {"file": row["path"].relative_to(folder).as_posix()} | told


def earlier(path: Path) -> list[dict[str, str]]:
    """Read an earlier table; one that is not there has no lines."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write(path: Path, columns: Sequence[str], lines: Sequence[dict[str, str]]) -> None:
    """Write a table, by the names of files, of each the last line; columns that are empty are left out."""
    kept = {line["file"]: line for line in lines}
    told = [name for name in columns if any(line.get(name) for line in kept.values())]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(
            file, ("file", *told), restval="", extrasaction="ignore", lineterminator="\n"
        )
        writer.writeheader()
        writer.writerows(kept[name] for name in sorted(kept))


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
    places = [*folder.glob("packings/*/*.h5"), *folder.glob("ladder/*/*.h5")]
    packings = [place for place in places if not place.name.endswith(OTHERS)]
    tables: dict[str, tuple[Sequence[str], list[dict[str, Any]]]] = {
        name: (PACKING, rows_of((p for p in packings if table_of(p, folder) == name), told_packing))
        for name in sorted({table_of(place, folder) for place in packings})
    }
    tables["modes"] = MODES, rows_of(folder.glob("modes/*/*.modes.h5"), told_modes)
    tables["shears"] = SHEAR, rows_of(folder.glob("shears/*.h5"), told_shear)
    tables["runs"] = RUN, rows_of(folder.glob("runs/*.h5"), told_run)
    if series := rows_of(folder.glob("series/*.json"), told_series):
        known_names = dict.fromkeys(name for row in series for name in row if name != "path")
        tables["series"] = tuple(known_names), series
    for name, (columns, rows) in tables.items():
        known = earlier(options.known / f"{name}.csv") if options.known else []
        lines = [*known, *(cells(row, columns, folder) for row in rows)]
        write(options.out / f"{name}.csv", columns, lines)
    counts = {name: len(rows) for name, (_, rows) in tables.items()}
    made = [row for _, rows in tables.values() for row in rows if "outcome" in row]
    report({"out": options.out, **counts, "not_reached": sum(not is_reached(row) for row in made)})


if __name__ == "__main__":
    parser = parser_of(__doc__, "samples")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of jamshape reproduce")
    parser.add_argument("--known", type=Path, metavar="TABLES", help="folder of earlier tables")
    run(parser, main)
