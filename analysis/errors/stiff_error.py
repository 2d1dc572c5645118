"""Error and cost of the implicit integrator of slow compressions, compared with Heun's method.

    python analysis/errors/stiff_error.py --alpha 4 --n 256 --kappas 1e-6 1e-8 1e-10 --out runs/stiff_error

One state just below jamming is compressed through it at each rate with each tolerance; errors of p are against
the run of that rate with the smallest tolerance. The cost of Heun's method with dt = 0.01 is that of a
measured stretch times the number of its steps. Writes a table (Markdown), a picture and the numbers
(JSON); finished runs are kept and not repeated. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import math
import time
from argparse import ArgumentParser, Namespace
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

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.implicit import METHODS, Flow, Protocol, Step, compress
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.packing import Packing, State
from jamshape.protocols.approach import compressed_start
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

HEUN_DT = 0.01
HEUN_STEPS = 2000
SAMPLES = 60
RATE_BEFORE = 1e-6


class Row(NamedTuple):
    """Cost of a run, relative errors of its pressures, and how much less than Heun's method that is."""

    kappa: float
    tolerance: float
    steps: int
    evaluations: int
    factorisations: int
    rejected: int
    explicit: int
    cpu_seconds: float
    phi_reached: float
    median: float
    """NaN for the reference"""
    largest: float
    fewer_evaluations: float
    less_time: float


def start_state(options: Namespace) -> Packing:
    """Make the state that every run starts from, once: Heun first, then slowly."""

    def make() -> Packing:
        particles = Particles.of(alpha=options.alpha)
        start = random_packing(options.n, 0.4, options.seed, particles)
        packing = compressed_start(start, options.phi_from - 0.05)
        landscape, flow = Landscape(packing), Flow(State.of(packing))
        for _ in compress(landscape, flow, Protocol(RATE_BEFORE, options.phi_from)):
            pass
        return flow.state.packing(packing)

    name = f"start_{options.alpha:g}_{options.n}_{options.seed}.h5"
    return kept_packing(options.out / name, make)


def run_with(start: Packing, options: Namespace, kappa: float, tolerance: float) -> dict[str, Any]:
    """Compress; pressures at common packing fractions, and what they cost."""
    samples = np.linspace(start.phi, options.phi_to, SAMPLES + 1)
    # Steps end where the rate may change.
    rates = tuple((float(phi), kappa) for phi in samples[:-1])
    protocol = Protocol(rates, options.phi_to, tolerance=tolerance, method=options.method)
    phi: list[float] = []
    p, began = [], time.process_time()
    bar = tqdm(total=SAMPLES, desc=f"kappa {kappa:g} tolerance {tolerance:g}", leave=False)
    for step in compress(Landscape(start), Flow(State.of(start)), protocol):
        # A short first step is no sample yet.
        if len(phi) < SAMPLES and abs(step.phi - samples[1 + len(phi)]) < 1e-11:
            phi.append(step.phi)
            p.append(step.pressure)
            bar.update()
        cpu = time.process_time() - began
        if cpu > options.seconds:
            break
    told = {"kappa": kappa, "tolerance": tolerance, "method": options.method, "phi_from": start.phi}
    return told | {"phi": phi, "pressure": p, "cpu_seconds": cpu} | end_of(step)


def end_of(step: Step) -> dict[str, Any]:
    """Give the counts of a run at its end."""
    counts = step._asdict()
    reached = {"phi_reached": counts.pop("phi"), "steps": counts.pop("step")}
    del counts["pressure"]
    return reached | counts


def heun_cost(start: Packing) -> dict[str, float]:
    """Seconds of an evaluation in LAMMPS, by a stretch of Heun steps, in processor time."""
    with Session() as session:
        compression = CompressionRun(
            session, Compression(kappa=1e-6, phi_end=10.0, dt=HEUN_DT, sides=2), start
        )
        compression.advance(session.step + 100)
        began = time.process_time()
        compression.advance(session.step + HEUN_STEPS)
        return {"seconds_per_step": (time.process_time() - began) / HEUN_STEPS}


def row(found: dict[str, Any], reference: dict[str, Any], heun: dict[str, float]) -> Row:
    """Compare a run with the reference and with Heun's method."""
    n = min(len(found["pressure"]), len(reference["pressure"]))
    p, exact = np.array(found["pressure"][:n]), np.array(reference["pressure"][:n])
    error = np.abs(p - exact) / exact if found is not reference else np.full(n, np.nan)
    steps = found["strain"] / (found["kappa"] * HEUN_DT)
    same = {name: found[name] for name in Row._fields[:9]}
    return Row(
        **same,
        median=float(np.median(error)),
        largest=float(error.max(initial=0)),
        fewer_evaluations=2 * steps / found["evaluations"],
        less_time=steps * heun["seconds_per_step"] / found["cpu_seconds"],
    )


def table(rows: list[Row]) -> str:
    """Write the rows as Markdown."""
    heads = (
        *("kappa", "tolerance", "steps", "evaluations", "factorisations", "seconds"),
        *("p: median error", "p: largest", "evaluations: fewer than Heun by", "time: less by"),
    )
    cells = [
        (f"{r.kappa:g}", f"{r.tolerance:g}", f"{r.steps}", f"{r.evaluations}", f"{r.factorisations}",
         f"{r.cpu_seconds:.3g}", f"{r.median:.1e}", f"{r.largest:.1e}",
         f"{r.fewer_evaluations:.1e}", f"{r.less_time:.1e}")
        for r in rows
    ]  # fmt: skip
    return markdown(heads, cells)


def draw(runs: list[dict[str, Any]], rows: list[Row], options: Namespace, name: str) -> None:
    """p(phi) of the smallest tolerances, and errors against run time."""
    title = rf"rods, $\alpha$ = {options.alpha:g}, $N$ = {options.n}, {options.method}"
    figure = figure_of(9, 4.2, title)
    left, right = figure.subplots(1, 2)
    kappas = sorted({found["kappa"] for found in runs}, reverse=True)
    for k, kappa in enumerate(kappas):
        of = [found for found in runs if found["kappa"] == kappa]
        best = min(of, key=lambda found: found["tolerance"])
        label = rf"$\kappa$ = {kappa:g}"
        left.semilogy(best["phi"], best["pressure"], color=f"C{k}", label=label)
        points = [r for r in rows if r.kappa == kappa and math.isfinite(r.median)]
        errors = [(r.cpu_seconds, r.median, r.largest) for r in points]
        median_and_largest(right, f"C{k}", errors)
    left.set(xlabel=r"packing fraction $\phi$", ylabel="pressure $p$")
    right.set(xlabel="CPU time (s)", ylabel="relative error of p")
    left.legend(fontsize=8)
    name_median_and_largest(right)
    save_figure(figure, options.out / name)


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/stiff_error")
    add = found.add_argument
    add("--alpha", type=float, default=4.0)
    add("--n", type=int, default=256)
    add("--seed", type=int, default=1)
    add("--kappas", type=float, nargs="+", default=[1e-6, 1e-7, 1e-8, 1e-9, 1e-10])
    add("--tolerances", type=float, nargs="+", default=[1e-2, 1e-3, 1e-4])
    add("--phi-from", type=float, default=0.845)
    add("--phi-to", type=float, default=0.87)
    add("--method", choices=METHODS, default="tr-bdf2")
    add("--seconds", type=float, default=1e9, help="for one run, at most")
    add("--quick", action="store_true", help="N = 32, two rates, under a minute")
    return found


def main(options: Namespace) -> None:
    """Measure, draw, report."""
    if options.quick:
        options.n, options.kappas, options.tolerances = 32, [1e-6, 1e-8], [1e-2, 1e-3]
        options.phi_to, options.seconds = options.phi_from + 0.005, 10.0
    options.out.mkdir(parents=True, exist_ok=True)
    start, runs, rows = start_state(options), [], []
    tag = f"{options.alpha:g}_{options.n}_{options.seed}_{options.phi_to:g}"
    cost = options.out / f"heun_{options.alpha:g}_{options.n}.json"
    heun = kept(cost, heun_cost, start)
    for kappa in options.kappas:
        for tolerance in sorted(options.tolerances, reverse=True):
            path = options.out / f"run_{tag}_{options.method}_{kappa:g}_{tolerance:g}.json"
            runs.append(kept(path, run_with, start, options, kappa, tolerance))
        rows += [row(r, runs[-1], heun) for r in runs if r["kappa"] == kappa]
        text = table(rows)
        (options.out / f"stiff_error_{tag}.md").write_text(text)
    draw(runs, rows, options, f"stiff_error_{tag}.png")
    print(text)
    points = [
        Point(f"kappa = {r.kappa:g}, alpha = {options.alpha:g}", r.cpu_seconds, r.median)
        for r in rows
    ]
    of = {"alpha": options.alpha, "n": options.n}
    report({"out": options.out, **of, "heun": heun, "rows": rows, "curves": curves(points)})


if __name__ == "__main__":
    run(parser(), main)
