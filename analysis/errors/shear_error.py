"""Error against run time of the integrators under steady simple shear, explicit and implicit.

    python analysis/errors/shear_error.py --out runs/shear_error

Rods (alpha = 4), nearly round ones (alpha = 0.01) and discs, `sides two`, near jamming. Each is sheared for a strain of 0.5 first,
and then with each integrator and tolerance over a strain of 0.02, in which rearrangements begin to tell runs apart; errors of
the pressure at forty strains are against rkc2 with a tolerance of 1e-7 (1e-6 at rates of 1e-6). Heun's method runs for a short stretch, and its
cost is extrapolated. Writes a table (Markdown), a picture and the numbers (JSON); finished runs are kept and not repeated.
Seconds are of the processor. With --pressure the height of the box yields to that normal pressure, also
before. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import itertools
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from studies.kept import kept, kept_packing
from studies.shown import (
    Point,
    curves,
    figure_of,
    markdown,
    median_and_largest,
    name_median_and_largest,
)
from tqdm import tqdm

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import scientific
from jamshape.files.h5md import read_packing
from jamshape.flow.implicit import METHODS as IMPLICIT
from jamshape.flow.implicit import Flow, follow
from jamshape.flow.shear import Shear, ShearRun
from jamshape.flow.slow_shear import SlowShear
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing

PHI = {4.0: 0.9, 0.01: 0.845, 0.0: 0.845}  # under alpha
STRAIN, ROWS, BEFORE, RATE_BEFORE = 0.02, 40, 0.5, 1e-4
REFERENCE = "rkc2"
METHODS = (
    ("heun/adaptive", 1e-4), ("rkc2", 1e-3), ("rkc2", 1e-4), ("rkc2", 1e-5),
    ("tr-bdf2", 1e-2), ("tr-bdf2", 1e-3), ("tr-bdf2", 1e-4),
)  # fmt: skip
HEUN_DT, HEUN_STEPS = 0.05, 2000
BOX_STRAIN = 0.01  # strain in whose time the height of a box at a pressure relaxes
SLOW = 1e-6
COLOURS = {"heun": "0.4", "heun/adaptive": "C0", "rkc2": "C1", "tr-bdf2": "C2"}


class Case(NamedTuple):
    """One shear, which all methods repeat."""

    n: int
    alpha: float
    gdot: float
    pressure: float = 0.0

    @property
    def held(self) -> dict[str, Any]:
        """Settings of a pressure to hold."""
        if not self.pressure:
            return {}
        return {"hold_pressure": self.pressure, "t_box": BOX_STRAIN / self.gdot}

    @property
    def finest(self) -> float:
        """Tolerance of the reference."""
        return 1e-7 if self.gdot > SLOW else 1e-6

    @property
    def name(self) -> str:
        """Name in files."""
        held = f"_p{self.pressure:g}" if self.pressure else ""
        return f"n{self.n}_alpha{self.alpha:g}_gdot{self.gdot:g}{held}"


class Row(NamedTuple):
    """Cost of a method, and its relative errors of the pressure."""

    n: int
    alpha: float
    gdot: float
    pressure: float
    method: str
    tolerance: float | None
    evaluations: float
    seconds: float
    median: float
    largest: float

    @property
    def case(self) -> Case:
        """Its shear."""
        return Case(self.n, self.alpha, self.gdot, self.pressure)


def start_state(folder: Path, case: Case) -> Packing:
    """Make the state that every run starts from, once: sheared a while."""

    def make() -> Packing:
        particles = js.Spherocylinders(alpha=case.alpha)
        run = js.shear(particles, n=case.n, phi=PHI[case.alpha], gdot=RATE_BEFORE, strain=BEFORE,
                       pressure=case.pressure, rows=50, frames=1, progress=False)  # fmt: skip
        return read_packing(run.file)

    held = f"_p{case.pressure:g}" if case.pressure else ""
    return kept_packing(folder / f"start_n{case.n}_alpha{case.alpha:g}{held}.h5", make)


def explicit(start: Packing, settings: Shear, rows: int) -> dict[str, Any]:
    """Pressures at the rows of a run in LAMMPS, and the cost."""
    with Session() as session:
        shear = ShearRun(session, settings, start)
        began, p, per_row = time.process_time(), [], shear.last_step // rows
        for k in range(1, rows + 1):
            shear.advance(k * per_row)
            p.append(shear.measure()["pressure"])
        seconds = time.process_time() - began
        return {"pressure": p, "seconds": seconds, "evaluations": shear.measure()["evaluations"]}


def implicit(start: Packing, course: SlowShear) -> dict[str, Any]:
    """Pressures at the rows of a run by implicit steps, and the cost."""
    landscape, flow, p = Landscape(start), Flow(State.of(start)), []
    began = time.process_time()
    for k in range(1, ROWS + 1):
        *_, last = follow(landscape, flow, replace(course, strain_end=k * STRAIN / ROWS))
        p.append(last.pressure)
    seconds = time.process_time() - began
    return {"pressure": p, "seconds": seconds, "evaluations": float(flow.evaluations)}


def found_by(folder: Path, case: Case, method: str, tolerance: float) -> dict[str, Any]:
    """Return the run of before, or make it."""

    def make() -> dict[str, Any]:
        start = start_state(folder, case)
        if method in IMPLICIT:
            slow = SlowShear(case.gdot, STRAIN, tolerance=tolerance, method=method, **case.held)
            return implicit(start, slow)
        settings = Shear(gdot=case.gdot, strain_end=STRAIN, sides=2, integrator=method, tolerance=tolerance,
                         **case.held)  # fmt: skip
        return explicit(start, settings.in_steps(ROWS), ROWS)

    return kept(folder / f"{case.name}_{method.replace('/', '-')}_{tolerance:g}.json", make)


def heun(folder: Path, case: Case) -> dict[str, Any]:
    """Heun's method for a while: its cost for the whole, and its error at the end of the stretch."""

    def make() -> dict[str, Any]:
        start, stretch = start_state(folder, case), HEUN_STEPS * HEUN_DT * case.gdot
        fine = Shear(gdot=case.gdot, strain_end=stretch, sides=2, integrator=REFERENCE,
                     tolerance=case.finest, **case.held)  # fmt: skip
        exact = explicit(start, fine.in_steps(1), 1)["pressure"][-1]
        found = explicit(
            start, Shear(gdot=case.gdot, strain_end=stretch, sides=2, dt=HEUN_DT, **case.held), 1
        )
        times = STRAIN / stretch
        cost = {name: found[name] * times for name in ("seconds", "evaluations")}
        return cost | {"error": abs(found["pressure"][-1] / exact - 1)}

    return kept(folder / f"{case.name}_heun.json", make)


def rows_of(folder: Path, case: Case) -> Iterator[Row]:
    """Rows of the table for one shear."""
    exact = np.array(found_by(folder, case, REFERENCE, case.finest)["pressure"])
    of = heun(folder, case)
    yield Row(*case, "heun", None, of["evaluations"], of["seconds"], of["error"], of["error"])
    for method, tolerance in METHODS:
        of = found_by(folder, case, method, tolerance)
        error = np.abs(np.array(of["pressure"]) - exact) / exact
        cost = (of["evaluations"], of["seconds"])
        yield Row(*case, method, tolerance, *cost, float(np.median(error)), float(error.max()))


def table(rows: list[Row]) -> str:
    """Write the rows as Markdown."""
    heads = ("N", "alpha", "gdot", "integrator", "tolerance", "evaluations", "seconds",
             "p: median error", "largest")  # fmt: skip
    extrapolated = f"dt = {HEUN_DT}, extrapolated"
    return markdown(heads, [
        (str(r.n), f"{r.alpha:g}", f"{r.gdot:g}", r.method,
         extrapolated if r.tolerance is None else f"{r.tolerance:g}",
         f"{r.evaluations:.2g}", f"{r.seconds:.2g}", f"{r.median:.1e}", f"{r.largest:.1e}")
        for r in rows
    ])  # fmt: skip


def draw(rows: list[Row], path: Path) -> None:
    """Errors against seconds, a panel for each shear."""
    cases = list(dict.fromkeys(r.case for r in rows))
    columns = len({case.gdot for case in cases})
    lines = -(-len(cases) // columns)
    figure = figure_of(
        3.4 * columns, 2.9 * lines, "error of the pressure against run time under shear"
    )
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    for axis, case in zip(panels.flat, cases, strict=False):
        for method, colour in COLOURS.items():
            of = [r for r in rows if r.case == case and r.method == method]
            median_and_largest(axis, colour, [(r.seconds, r.median, r.largest) for r in of])
            axis.plot([], [], "-", color=colour, label=method)
        title = rf"$N={case.n}$, $\alpha={case.alpha:g}$, $\dot\gamma={scientific(case.gdot)}$"
        axis.set_title(title, fontsize=9)
        axis.grid(visible=True, alpha=0.3)
    for axis in panels[:, 0]:
        axis.set_ylabel("relative error of $p$")
    for axis in panels[-1]:
        axis.set_xlabel("CPU time (s)")
    name_median_and_largest(panels[0, 0])
    save_figure(figure, path)


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/shear_error")
    found.add_argument("--n", type=int, nargs="+", default=[128])
    found.add_argument("--alpha", type=float, nargs="+", default=list(PHI), choices=list(PHI))
    found.add_argument("--gdot", type=float, nargs="+", default=[1e-4, 1e-5, 1e-6])
    found.add_argument(
        "--pressure", type=float, help="normal pressure to hold, instead of the volume"
    )
    found.add_argument("--quick", action="store_true", help="N = 16, gdot = 1e-4, alpha = 4")
    return found


def main(options: Namespace) -> None:
    """Measure, draw, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    if options.quick:
        options.n, options.gdot, options.alpha = [16], [1e-4], [4.0]
    cases = [
        Case(n, alpha, gdot, options.pressure or 0.0)
        for n, alpha, gdot in itertools.product(options.n, options.alpha, options.gdot)
    ]
    rows: list[Row] = []
    with tqdm(cases, unit="case") as bar:
        for case in bar:
            bar.set_postfix_str(case.name)
            rows += rows_of(options.out, case)
            text = table(rows)
            (options.out / "shear_error.md").write_text(text)
            draw(rows, options.out / "shear_error.png")
    print(text)
    points = [
        Point(f"{r.method}, N = {r.n}, alpha = {r.alpha:g}, gdot = {r.gdot:g}", r.seconds, r.median)
        for r in rows
    ]
    report({"out": options.out, "rows": rows, "curves": curves(points)})


if __name__ == "__main__":
    run(parser(), main)
