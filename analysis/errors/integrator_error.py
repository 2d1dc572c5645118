"""Error against cost of the integrators of `fix overdamped/affine`, at slow rates through jamming.

    python analysis/errors/integrator_error.py --out runs/integrator_error

Rods (alpha = 4) and nearly round ones (alpha = 0.01), `sides two`, are compressed from a little below
jamming to beyond it with each integrator and tolerance; errors of the pressure are against a run with
a tolerance of 1e-7 (1e-6 for alpha = 0.01 at kappa = 1e-6, where one particle that rests on a kink of
the energy takes most of the steps: 1e-7 does not end in minutes). Heun's method with dt = 0.01 is run for a short stretch, and its cost
extrapolated. Writes a table (Markdown), a picture and the numbers (JSON); finished runs are kept and
not repeated. Seconds are of the processor. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import itertools
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from studies.kept import compressed, kept, kept_packing
from studies.shown import Point, curves, figure_of, markdown
from tqdm import tqdm

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.packing import Packing
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

PHI_START, KAPPA_START = 0.4, 1e-4
PHI = {4.0: (0.84, 0.88), 0.01: (0.83, 0.86)}  # from and to, under alpha
ROWS = 40
REFERENCE = ("rkc2", 1e-7)
LOOSER = {(0.01, 1e-6): 1e-6}  # tolerance of the reference, under alpha and kappa
METHODS = (
    ("heun/adaptive", 1e-3), ("heun/adaptive", 1e-4),
    ("rkc2", 1e-3), ("rkc2", 1e-4), ("rkc2", 1e-5),
)  # fmt: skip
HEUN_DT, HEUN_STEPS = 0.01, 4000
COLOURS = {"heun": "0.4", "heun/adaptive": "tab:blue", "rkc2": "tab:red"}


class Case(NamedTuple):
    """One compression, which all methods repeat."""

    n: int
    alpha: float
    kappa: float

    @property
    def name(self) -> str:
        """Name in files."""
        return f"n{self.n}_alpha{self.alpha:g}_kappa{self.kappa:g}"

    def settings(self, method: str, tolerance: float) -> Compression:
        """Return what the run is told."""
        phi_from, phi_to = PHI[self.alpha]
        told = Compression(
            kappa=self.kappa, phi_end=phi_to, sides=2, integrator=method, tolerance=tolerance
        )
        return told.in_steps(phi_from, ROWS)


class Row(NamedTuple):
    """Cost of a method, and its relative errors of the pressure."""

    n: int
    alpha: float
    kappa: float
    method: str
    tolerance: float | None
    evaluations: float
    seconds: float
    rejected: float | None
    median: float
    largest: float | None
    """None for Heun's method, of which a stretch alone is run."""

    @property
    def case(self) -> Case:
        """Its compression."""
        return Case(self.n, self.alpha, self.kappa)


def start_state(folder: Path, case: Case) -> Packing:
    """Make the state that every run starts from, once."""

    def make() -> Packing:
        start = random_packing(case.n, PHI_START, 1, Particles.of(alpha=case.alpha))
        return compressed(
            start, Compression(kappa=KAPPA_START, phi_end=PHI[case.alpha][0], dt=0.1, sides=2)
        )

    return kept_packing(folder / f"start_n{case.n}_alpha{case.alpha:g}.h5", make)


def run_with(start: Packing, settings: Compression, steps: int) -> dict[str, Any]:
    """Pressures at the rows, and the cost."""
    with Session() as session:
        compression = CompressionRun(session, settings, start)
        began, p = time.process_time(), []
        for k in range(1, steps + 1):
            compression.advance(k)
            p.append(compression.measure()["pressure"])
        seconds = time.process_time() - began
        last = compression.measure()
    names = ("evaluations", "substeps", "rejected", "forced")
    return {"pressure": p, "seconds": seconds} | {name: last.get(name, 0.0) for name in names}


def heun_stretch(start: Packing, case: Case) -> dict[str, Any]:
    """Heun's method for a while: its cost for the whole, and its error at the end of the stretch."""
    whole = case.settings("heun", 1.0)
    fine = Compression(kappa=case.kappa, phi_end=whole.phi_end, dt=HEUN_STEPS * HEUN_DT, sides=2,
                       integrator=REFERENCE[0], tolerance=REFERENCE[1])  # fmt: skip
    exact = run_with(start, fine, 1)["pressure"][-1]
    settings = Compression(kappa=case.kappa, phi_end=whole.phi_end, dt=HEUN_DT, sides=2)
    with Session() as session:
        compression = CompressionRun(session, settings, start)
        began = time.process_time()
        compression.advance(HEUN_STEPS)
        seconds = time.process_time() - began
        error = abs(compression.measure()["pressure"] / exact - 1)
    times = ROWS * whole.dt / (HEUN_STEPS * HEUN_DT)
    return {"seconds": seconds * times, "evaluations": 2 * HEUN_STEPS * times, "error": error}


def found_by(folder: Path, case: Case, method: str, tolerance: float) -> dict[str, Any]:
    """Return the run of before, or make it."""

    def make() -> dict[str, Any]:
        start = start_state(folder, case)
        if method == "heun":
            return heun_stretch(start, case)
        return run_with(start, case.settings(method, tolerance), ROWS)

    return kept(folder / f"{case.name}_{method.replace('/', '-')}_{tolerance:g}.json", make)


def rows_of(folder: Path, case: Case, reference: float) -> Iterator[Row]:
    """Rows of the table for one compression."""
    exact = np.array(found_by(folder, case, REFERENCE[0], reference)["pressure"])
    heun = found_by(folder, case, "heun", HEUN_DT)
    cost = (heun["evaluations"], heun["seconds"], None)
    yield Row(*case, "heun", None, *cost, heun["error"], None)
    for method, tolerance in METHODS:
        of = found_by(folder, case, method, tolerance)
        error = np.abs(np.array(of["pressure"]) - exact) / exact
        cost = (of["evaluations"], of["seconds"], of["rejected"] / of["substeps"])
        yield Row(*case, method, tolerance, *cost, float(np.median(error)), float(error.max()))


def table(rows: list[Row]) -> str:
    """Write the rows as Markdown."""
    heads = ("N", "alpha", "kappa", "integrator", "tolerance", "evaluations", "seconds",
             "p: median error", "largest")  # fmt: skip
    extrapolated = f"dt = {HEUN_DT}, extrapolated"
    cells = [
        (str(r.n), f"{r.alpha:g}", f"{r.kappa:g}", r.method,
         extrapolated if r.tolerance is None else f"{r.tolerance:g}",
         f"{r.evaluations:.2g}", f"{r.seconds:.2g}", f"{r.median:.1e}",
         "" if r.largest is None else f"{r.largest:.1e}")
        for r in rows
    ]  # fmt: skip
    return markdown(heads, cells)


def draw(rows: list[Row], path: Path) -> None:
    """Errors against evaluations, a panel for each compression."""
    cases = sorted({r.case for r in rows}, key=lambda c: (c.alpha, c.n, -c.kappa))
    columns = min(len(cases), 4)
    lines = -(-len(cases) // columns)
    figure = figure_of(3.2 * columns, 3 * lines)
    axes = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    for axis, case in itertools.zip_longest(axes.flat, cases):
        if case is None:
            axis.set_visible(False)
        else:
            draw_case(axis, case, [r for r in rows if r.case == case])
    for axis in axes[:, 0]:
        axis.set_ylabel("relative error of p")
    for axis in axes[-1]:
        axis.set_xlabel("force evaluations")
    axes[0, 0].legend(title="filled: median, open: largest", fontsize=7, title_fontsize=7)
    save_figure(figure, path)


def draw_case(axis: Any, case: Case, rows: list[Row]) -> None:
    """Draw one panel."""
    for method, colour in COLOURS.items():
        of = [r for r in rows if r.method == method]
        cost = [r.evaluations for r in of]
        axis.loglog(cost, [r.median for r in of], "o-", color=colour, label=method)
        if method != "heun":
            axis.loglog(cost, [r.largest for r in of], "s--", color=colour, mfc="none")
    title = rf"$N$ = {case.n}, $\alpha$ = {case.alpha:g}, $\kappa$ = {case.kappa:g}"
    axis.set_title(title, fontsize=9)
    axis.grid(visible=True, alpha=0.3)


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/integrator_error")
    found.add_argument("--n", type=int, nargs="+", default=[128, 256])
    found.add_argument("--alpha", type=float, nargs="+", default=list(PHI), choices=list(PHI))
    found.add_argument("--kappa", type=float, nargs="+", default=[1e-5, 1e-6])
    found.add_argument("--quick", action="store_true", help="N = 32, kappa = 1e-4")
    return found


def main(options: Namespace) -> None:
    """Measure, draw, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    reference = REFERENCE[1]
    if options.quick:
        options.n, options.kappa, reference = [32], [1e-4], 1e-6
    cases = [Case(*c) for c in itertools.product(options.n, options.alpha, options.kappa)]
    rows: list[Row] = []
    with tqdm(cases, unit="case") as bar:
        for case in bar:
            bar.set_postfix_str(case.name)
            rows += rows_of(options.out, case, LOOSER.get((case.alpha, case.kappa), reference))
            text = table(rows)
            (options.out / "integrator_error.md").write_text(text)
            draw(rows, options.out / "integrator_error.png")
    print(text)
    points = [
        Point(
            f"{r.method}, N = {r.n}, alpha = {r.alpha:g}, kappa = {r.kappa:g}", r.seconds, r.median
        )
        for r in rows
    ]
    report({"out": options.out, "rows": rows, "curves": curves(points)})


if __name__ == "__main__":
    run(parser(), main)
