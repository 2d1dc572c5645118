"""Error against run time of every way to find modes, and how run time grows with the packing.

    python analysis/errors/spectrum_error.py SMALL.h5 [LARGER.h5 ...] --tiles 2 6 --out spectrum_error.png

Packings as make_packing.py writes them. On the left, for each packing and method, the relative error of every
mode against the refined spectrum (or the bound of that one, where it is larger), medians and largest in each
band. On the right, seconds against N; --tiles adds copies of the first packing beside each other, with the
stiffness of bonds varied by a tenth so that they differ, of which the 20 softest modes are found. Seconds
are of the processor. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from studies.shown import Point, curves, figure_of

from jamshape.arrays import FloatArray, IntArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import packing_text
from jamshape.files.ensembles import PackingFile
from jamshape.files.h5md import read_packing
from jamshape.landscape import Landscape
from jamshape.packing import Box, Packing, State
from jamshape.vibration.hessian import DynamicalMatrix, dynamical_matrix
from jamshape.vibration.sparse_modes import lowest
from jamshape.vibration.spectrum import Spectrum, spectrum
from jamshape.vibration.statistics import bands

METHODS = ("plain", "first_order", "projected", "refined", "sparse")
COLORS = dict(zip(METHODS, ("#999999", "#e69f00", "#0072b2", "#009e73", "#cc79a7"), strict=True))
MARKERS = {"low": "v", "middle": "s", "high": "^"}
SOFTEST = 20  # modes of copies
BEYOND = 10  # modes of the high band that the sparse method finds besides all below


class Timed(NamedTuple):
    """What a method found, and in how much time of the processor."""

    found: Spectrum
    seconds: float


def timed(call: Callable[[], Spectrum]) -> Timed:
    """Measure a call."""
    began = time.process_time()
    found = call()
    return Timed(found, time.process_time() - began)


def errors(found: Spectrum, reference: Spectrum) -> tuple[IntArray, FloatArray]:
    """Compare modes in order of size: rows of the reference, and relative errors of those whose sign it knows.

    A sparse spectrum holds the softest; its modes are those of the reference's that are softest.
    """
    real = np.flatnonzero(~reference.is_translation)
    rows = real[np.argsort(np.abs(reference.eigenvalues[real]), kind="stable")]
    ours = found.eigenvalues[~found.is_translation]
    rows = np.sort(rows[: len(ours)])
    difference = np.abs(np.sort(ours) - reference.eigenvalues[rows])
    size = np.abs(reference.eigenvalues[rows])
    sure = reference.sign[rows] != 0
    relative = np.maximum(difference, reference.solver_error[rows])[sure] / size[sure]
    return rows[sure], relative


def measure(path: Path) -> dict[str, Any]:
    """Run every method on one packing."""
    packing = read_packing(path)
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    runs = {m: timed(partial(spectrum, matrix, m)) for m in METHODS if m != "sparse"}
    reference = runs["refined"].found
    parts = bands(matrix, reference)
    n_below = sum(band.n_modes for band in parts if band.name != "high") if parts else 0
    runs["sparse"] = timed(lambda: lowest(matrix, n_below + BEYOND))
    rows: dict[str, Any] = {}
    for method, done in runs.items():
        which, relative = errors(done.found, reference)
        rows[method] = {"seconds": done.seconds, "bands": {}}
        for band in parts:
            own = relative[np.isin(which, band.modes)]
            if len(own):
                both = {"median": float(np.median(own)), "largest": float(own.max())}
                rows[method]["bands"][band.name] = {"modes": len(own), **both}
    return {"packing": str(path), "n": packing.n, "coordinates": matrix.size, "methods": rows}


def tiled(packing: Packing, k: int) -> tuple[Packing, State]:
    """Put k copies beside each other along each edge."""
    position, orientation, cell = packing.poses()
    shifts = np.array(list(np.ndindex(*(k,) * packing.dimension)))
    where = np.concatenate([position + cell @ shift for shift in shifts])
    turned, diameters = (
        np.concatenate([x] * len(shifts)) for x in (orientation, packing.diameters)
    )
    large = Packing(
        position=where.astype(np.float64),
        orientation=turned.astype(np.float64),
        diameters=diameters,
        form=np.tile(packing.form, (len(shifts), 1)),
        species=np.tile(packing.species, len(shifts)),
        id=np.arange(1, packing.n * len(shifts) + 1),
        box=Box.of(packing.box.lo, k * packing.box.matrix),
        shape_style=packing.shape_style,
    ).with_poses(where, turned, k * cell)
    return large, State.of(large)


def varied(matrix: DynamicalMatrix) -> DynamicalMatrix:
    """Vary the stiffness of every bond by a tenth, at random."""
    factors = 1 + 0.1 * np.random.default_rng(0).uniform(-1, 1, matrix.n_bonds)
    return replace(matrix, compatibility=scipy.sparse.diags(factors) @ matrix.compatibility)


def measure_tiles(path: Path, k: int) -> dict[str, Any]:
    """Time the sparse method on copies."""
    packing, state = tiled(read_packing(path), k)
    began = time.process_time()
    matrix = dynamical_matrix(Landscape(packing), state)
    assembly = time.process_time() - began
    found, seconds = timed(lambda: lowest(varied(matrix), SOFTEST))
    real = np.abs(found.eigenvalues) > found.bound
    relative = (found.bound / np.abs(found.eigenvalues))[real]
    return {
        "n": packing.n,
        "seconds": seconds,
        "assembly_seconds": assembly,
        "relative_bound": float(relative.max()) if len(relative) else None,
    }


def show(rows: list[dict[str, Any]], tiles: list[dict[str, Any]]) -> None:
    """Print both tables."""
    print("   n  method       seconds  band     modes  median error  largest error")
    for row in rows:
        for method, of in row["methods"].items():
            for band, e in of["bands"].items():
                start = f"{row['n']:5} {method:11} {of['seconds']:9.3g}  {band:7}"
                print(f"{start} {e['modes']:6}  {e['median']:12.2e}  {e['largest']:13.2e}")
    for tile in tiles:
        print(f"{tile['n']} particles, {SOFTEST} softest modes: {tile['seconds']:.3g} s")


def draw(rows: list[dict[str, Any]], tiles: list[dict[str, Any]], out: Path) -> None:
    """Draw errors and growth."""
    titles = {packing_text(PackingFile.read(Path(row["packing"]))) for row in rows}
    figure = figure_of(11, 4.5, "\n".join(sorted(text.replace("\n", ", ") for text in titles)))
    left, right = figure.subplots(1, 2)
    draw_errors(left, rows)
    draw_growth(right, rows, tiles)
    save_figure(figure, out)


def draw_errors(axis: Any, rows: list[dict[str, Any]]) -> None:
    """Draw a line from the median to the largest error of each band."""
    for row in rows:
        for method, of in row["methods"].items():
            for band, e in of["bands"].items():
                values = [max(e[key], 1e-20) for key in ("median", "largest")]
                style: dict[str, Any] = {"color": COLORS[method], "marker": MARKERS[band]}
                axis.loglog([of["seconds"]] * 2, values, **style, mfc="none", lw=0.8)
    for band, marker in MARKERS.items():
        axis.plot([], [], marker, color="0.3", mfc="none", label=f"{band} band")
    axis.set_xlabel("seconds")
    axis.set_ylabel("relative error of eigenvalues, median and largest")
    # Errors fill the whole panel, so that no corner is free.
    axis.legend(fontsize=8, ncols=len(MARKERS), loc="lower center", bbox_to_anchor=(0.5, 1.0))


def draw_growth(axis: Any, rows: list[dict[str, Any]], tiles: list[dict[str, Any]]) -> None:
    """Draw seconds against the number of particles."""
    n = [row["n"] for row in rows]
    for method in METHODS:
        seconds = [row["methods"][method]["seconds"] for row in rows]
        axis.loglog(n, seconds, "o-", color=COLORS[method], label=method.replace("_", " "))
    if tiles:
        label = f"sparse, {SOFTEST} softest of copies"
        x, y = [t["n"] for t in tiles], [t["seconds"] for t in tiles]
        axis.loglog(x, y, "D--", color=COLORS["sparse"], mfc="none", label=label)
    axis.set_xlabel("particles")
    axis.set_ylabel("seconds")
    axis.legend(fontsize=8)


def points(rows: list[dict[str, Any]]) -> Iterator[Point]:
    """Largest relative errors of each band against seconds, one curve for each method and band."""
    for row in rows:
        for method, of in row["methods"].items():
            for band, errors_of in of["bands"].items():
                name = f"{method.replace('_', ' ')}, {band} band"
                yield Point(name, of["seconds"], errors_of["largest"])


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "spectrum_error.png")
    found.add_argument("packings", type=Path, nargs="+", metavar="PACKING.h5")
    found.add_argument("--tiles", type=int, nargs="*", default=[], help="copies along each edge")
    return found


def main(options: Namespace) -> None:
    """Measure, draw, report."""
    rows = [measure(path) for path in options.packings]
    tiles = [measure_tiles(options.packings[0], k) for k in options.tiles]
    show(rows, tiles)
    draw(rows, tiles, options.out)
    found = {"out": options.out, "packings": rows, "tiles": tiles}
    report(found | {"curves": curves(points(rows))})


if __name__ == "__main__":
    run(parser(), main)
