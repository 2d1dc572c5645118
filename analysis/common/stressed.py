"""Packings at rising pressures and their elastic moduli, in files that are kept and not computed again."""

from __future__ import annotations

import csv
import json
import os
import warnings
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

import jamshape as js
from jamshape.arrays import FloatArray, IntArray
from jamshape.checks import NotReachedWarning
from jamshape.command import plain
from jamshape.files.disk import store
from jamshape.landscape import Landscape, State
from jamshape.minima.target import TargetError
from jamshape.packing import Packing
from jamshape.recording.workers import Workers
from jamshape.shapes.particles import Particles
from jamshape.vibration.elasticity import Moduli, moduli
from jamshape.vibration.hessian import DynamicalMatrix, NotAtMinimumError, dynamical_matrix

SEED = 1  # of the bootstrap
DRAWS = 1000

# Modules of workers lie in a folder that Python does not know.
_HERE = str(Path(__file__).parents[1])
_COMPRESSED = "common.stressed:compressed"
FOLLOWED = "common.stressed:followed"

# Relative step of the pressure to the same contacts: far less than between changes of contacts, and the change of G is
# far above the bounds of both.
STEP = 1e-3


# Numbers of a packing at each of its pressures, in tables.
AT_PRESSURE = ("G", "slope")


class Series(NamedTuple):
    """Packings of rods, of one seed, at several pressures."""

    alpha: float
    n: int
    box: str
    seed: int
    pressures: tuple[float, ...]
    """Ascending, [k_e / R^2]."""

    @property
    def file(self) -> str:
        """Name of the file of its results."""
        span = f"p{self.pressures[0]:.3g}_{self.pressures[-1]:.3g}_{len(self.pressures)}"
        box = self.box.replace(" ", "-")
        return f"a{self.alpha:g}_n{self.n}_{box}_{span}_s{self.seed}.json"


def add_options(parser: ArgumentParser, samples: int) -> None:
    """Add the options that choose packings of rods at rising pressures."""
    parser.add_argument(
        "--pressures", type=float, nargs=2, default=[1e-6, 1e-2], metavar=("LOW", "HIGH"),
        help="lowest and highest, in k_e / R^2 (1e-6 1e-2)",
    )  # fmt: skip
    parser.add_argument("--per-decade", type=int, default=2, help="pressures (%(default)s)")
    add_folder(parser, samples)


def add_folder(parser: ArgumentParser, samples: int) -> None:
    """Add the options of every study of many packings."""
    parser.add_argument("--samples", type=int, default=samples, help="packings (%(default)s)")
    parser.add_argument(
        "--runs", type=Path, default=Path("runs/stress"), help="folder of results (%(default)s)"
    )
    parser.add_argument("--table", type=Path, help="file of all numbers, JSON (beside the figure)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (%(default)s)")
    parser.add_argument(
        "--only-kept", action="store_true", help="draw from finished packings, make no others"
    )


def pressures_of(options: Namespace) -> tuple[float, ...]:
    """List the pressures of `add_options`, at equal ratios, to four digits."""
    (low, high), per_decade = options.pressures, options.per_decade
    n = round(np.log10(high / low) * per_decade) + 1
    return tuple(float(f"{p:.4g}") for p in np.geomspace(low, high, n))


def compressed(*series: Any) -> list[dict[str, Any]]:
    """Make the packing of a `Series` at its lowest pressure, raise the pressure, and measure at each."""
    return rows_along(Series(*series), lambda packing, _: measured(packing))


def rows_along(
    of: Series, measure: Callable[[js.Packing, float], dict[str, Any]]
) -> list[dict[str, Any]]:
    """Measure the packing of a series at each of its pressures, by a function of the packing and the pressure."""
    rows = []
    packing: js.Packing | None = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotReachedWarning)  # rows tell
        for p in of.pressures:
            try:
                packing = led(packing, of, p)
                rows.append({"pressure": p, **measure(packing, p)})
            except (TargetError, NotAtMinimumError) as error:  # the latter on a kink of the energy
                rows.append({"pressure": p, "reached": False, "failure": str(error)})
    return rows


def followed(*series: Any) -> list[dict[str, Any]]:
    """Do as `compressed`, and measure dG/dp with the same contacts at each pressure (`slope_of`)."""
    of = Series(*series)
    told = {"alpha": of.alpha, "n": of.n, "seed": of.seed}
    return [told | row for row in rows_along(of, lambda packing, p: _with_slope(packing, of, p))]


def _with_slope(packing: js.Packing, of: Series, pressure: float) -> dict[str, Any]:
    found = measured(packing)
    if not found["reached"]:
        return found
    try:
        return found | slope_of(packing, led(packing, of, pressure * (1 + STEP)))
    except (TargetError, NotAtMinimumError):
        return found  # only the slope is missing


def slope_of(packing: js.Packing, other: js.Packing) -> dict[str, Any]:
    """Measure dG/dp between two pressures of a packing.

    Returns
    -------
    dict
        ``same_contacts``, and where it is true ``slope`` with its bound: that of both moduli.
    """
    if not other.reached:
        return {}
    states = [(of.pressure, *elasticity_of(of)) for of in (packing, other)]
    (p, matrix, elastic), (above, matrix_above, elastic_above) = states
    same = contacts_of(matrix) == contacts_of(matrix_above)
    if not same:
        return {"same_contacts": False}
    G, G_above = elastic.simple_shear, elastic_above.simple_shear
    slope = (G_above.relaxed - G.relaxed) / (above - p)
    bound = (G.bound + G_above.bound) / (above - p)
    return {"same_contacts": True, "slope": slope, "slope_bound": bound}


def contacts_of(matrix: DynamicalMatrix) -> set[tuple[int, ...]]:
    """List the bonds: both particles, and which bond of theirs it is."""
    columns = np.column_stack([matrix.bonds.particles, matrix.bonds.slot])
    return set(map(tuple, columns.tolist()))


def led(packing: js.Packing | None, of: Series, pressure: float) -> js.Packing:
    """Relax a packing at a pressure; None makes that of the series."""
    if packing is not None:
        return js.minimise(packing, pressure=pressure, box=of.box, progress=False)
    particles = Particles.of(alpha=of.alpha)
    return js.make_packing(
        particles, n=of.n, seed=of.seed, pressure=pressure, box=of.box, progress=False
    )


def measured(packing: js.Packing) -> dict[str, Any]:
    """Measure a packing at a minimum; moduli that are not defined are NaN."""
    found: dict[str, Any] = {"reached": packing.reached, "phi": packing.phi, "u": packing.u}
    if not packing.reached:
        return found
    matrix, elastic = elasticity_of(packing)
    named = {
        "G": elastic.simple_shear, "G_dc": elastic.B.G_dc, "G_min": elastic.B.G_min, "K": elastic.bulk,
    }  # fmt: skip
    found |= {name: one.relaxed for name, one in named.items()}
    found |= {f"{name}_bound": one.bound for name, one in named.items()}
    return found | {
        "n_particles": matrix.n_particles, "n_bonds": len(matrix.bonds.stiffness),
        "n_floppy": elastic.n_floppy, "n_negative": elastic.n_negative,
        "is_stable": elastic.is_stable_to_shear,
    }  # fmt: skip


def elasticity_of(packing: Packing) -> tuple[DynamicalMatrix, Moduli]:
    """Find the dynamical matrix of a packing and its moduli."""
    landscape, state = Landscape(packing), State.of(packing)
    matrix = dynamical_matrix(landscape, state)
    return matrix, moduli(matrix, at=(landscape, state))


class Task(Protocol):
    """Arguments of a function, as a tuple, with the file of its result."""

    @property
    def file(self) -> str:
        """Name of the file."""


def found_of(folder: Path, tasks: Sequence[Task], jobs: int, function: str = _COMPRESSED) -> None:
    """Compute all tasks without a file in the folder; an interruption keeps finished ones."""
    folder.mkdir(parents=True, exist_ok=True)
    missing: list[Any] = [one for one in tasks if not (folder / one.file).exists()]
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [_HERE, os.environ.get("PYTHONPATH")]))
    with Workers(function, [tuple(one) for one in missing], jobs) as workers:
        for k, done in enumerate(workers, 1):
            one = missing[done.number]
            if done.failure is not None:
                msg = f"{one.file}: {done.failure}"
                raise RuntimeError(msg)
            store(folder / one.file, json.dumps(plain(done.result)).encode())
            print(f"{k} of {len(missing)}: {one.file}", flush=True)


class Table(NamedTuple):
    """Results of m series of a system at k pressures."""

    pressures: FloatArray
    """(k,)"""
    rows: list[list[dict[str, Any]]]
    """m lists of k rows."""

    def column(self, name: str) -> FloatArray:
        """(m, k) numbers, NaN where a packing has none; truth is 1 or 0."""
        rows = [[row.get(name) for row in of] for of in self.rows]
        return np.array(rows, dtype=np.float64)

    def __len__(self) -> int:
        return len(self.rows)


def rows_of(folder: Path, tasks: Sequence[Task]) -> list[list[dict[str, Any]]]:
    """Read the results of those of the tasks that are finished."""
    paths = [folder / one.file for one in tasks]
    rows = [json.loads(path.read_text()) for path in paths if path.exists()]
    rows = [[with_sure_slope(row) for row in of] for of in rows]
    if not rows:
        msg = f"{folder} has no results of {tasks[0].file} and others, expected some; leave out --only-kept"
        raise ValueError(msg)
    return rows


def with_sure_slope(row: dict[str, Any]) -> dict[str, Any]:
    """Drop a slope whose sign is uncertain."""
    is_sure = row.get("slope") is None or row["slope_bound"] < abs(row["slope"])
    return row if is_sure else row | {"slope": None}


def of_pressure(name: str, row: Mapping[str, Any]) -> str:
    """Name the column of a number at the pressure of a row."""
    return f"{name} at {row['pressure']:g}"


def table_of(runs: Path, series: Iterable[Series]) -> Table:
    """Read the finished ones of series with the same pressures, from a folder or the table of sample_tables.py."""
    every = list(series)
    pressures = every[0].pressures
    read = _lines_of if runs.is_file() else rows_of
    return Table(np.array(pressures), read(runs, every))


def _lines_of(table: Path, series: Sequence[Series]) -> list[list[dict[str, Any]]]:
    with table.open(newline="", encoding="utf-8") as file:
        lines = {Path(line["file"]).name: line for line in csv.DictReader(file)}
    known = [(one.pressures, lines[one.file]) for one in series if one.file in lines]
    if not known:
        msg = f"{table} has no line of {series[0].file} and others, expected some; choose another table"
        raise ValueError(msg)
    return [[_at(line, p) for p in pressures] for pressures, line in known]


def _at(line: Mapping[str, str], pressure: float) -> dict[str, Any]:
    row: dict[str, Any] = {"pressure": pressure}
    cells = {name: line.get(of_pressure(name, row)) for name in AT_PRESSURE}
    return row | {name: float(cell) for name, cell in cells.items() if cell}


def write_table(options: Namespace, found: Any) -> None:
    """Write all numbers of a figure."""
    path = options.table or options.out.with_suffix(".json")
    store(path, f"{json.dumps(plain(found), indent=1)}\n".encode())


def draws(n: int) -> Iterator[IntArray]:
    """Draw n samples with replacement, many times."""
    random = np.random.default_rng(SEED)
    for _ in range(DRAWS):
        yield random.integers(0, n, n)


def mean_of(columns: FloatArray) -> FloatArray:
    """Average (m, k) samples, ignoring NaN; NaN where all are."""
    known = np.isfinite(columns)
    count = known.sum(axis=0)
    total = np.where(known, columns, 0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def mean_and_error(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Average (m, k) samples; the standard error by the bootstrap, NaN where a draw has none."""
    drawn = [mean_of(columns[k]) for k in draws(len(columns))]
    return mean_of(columns), np.std(drawn, axis=0)
