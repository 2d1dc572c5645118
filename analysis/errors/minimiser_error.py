"""Residual force against run time of every minimiser, and of both energy targets, on the same states.

    python analysis/errors/minimiser_error.py --n 256 --seconds 60 --out runs/minimisers
    python analysis/errors/minimiser_error.py --states runs/sweep3d/p1_w0.6_1_seed1.h5 --out runs/minimisers3d

States may also be packings of make_packing.py, superellipsoids as well. For every other state a packing at u0 = 1e-15
is made first, by the usual way (kept in the folder, and taken from there the next time); nearly round rods start from
jammed discs, given spines of random directions. All minimisers then start from it, each particle displaced at random by
1e-6 of its radius, which is many overlaps; the two energy targets start from it compressed by a strain of 1e-6. A curve
is the best residual so far; the table gives the seconds to residuals of 1e-4, 1e-6 and 1e-8, or what was reached, and how
many times as long as extrapolation the paper's takes, with our minimiser and as published. Seconds are those in
which the processor was busy; --seconds, after which a run ends, are those of the clock. Searches (--targets) that are left
out are missing in the table, unless the folder has them.
"""

from __future__ import annotations

import json
import math
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from studies.shown import figure_of, markdown
from tqdm import tqdm

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.disk import store
from jamshape.files.h5md import read_packing
from jamshape.landscape import Landscape
from jamshape.measures.packing_summary import write_minimum
from jamshape.minima import History, Stop, minimise
from jamshape.minima.minimise import Method
from jamshape.minima.target import Search, Target, TargetError, bisection, extrapolation, find
from jamshape.packing import Packing, State
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import Recipe, is_done, make
from jamshape.recording.recorder import How
from jamshape.shapes.particles import Kind, Particles
from jamshape.shapes.table import DEFAULT

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.spines import with_spines
from methods.lammps_cg import lammps_cg
from methods.lbfgs import lbfgs

MINIMISERS: dict[str, str | Method] = {
    "auto": "auto", "newton": "newton", "lbfgs": lbfgs, "lammps": lammps_cg, "cg_marschall": "cg_marschall",
}  # fmt: skip
LEVELS = (1e-4, 1e-6, 1e-8)
DISPLACEMENT = 1e-6
STRAIN = 1e-6
NEARLY_ROUND = 0.1

# Searches for u0 by method and tolerance: extrapolation, to the end and to a residual that the published
# algorithm can reach; the paper's; and the paper's with the paper's minimiser. All get this much more time.
TARGETS: dict[str, tuple[Callable[..., Any], str, float]] = {
    "extrapolation": (extrapolation, "auto", 1e-7),
    "extrapolation to 1e-4": (extrapolation, "auto", 1e-4),
    "bisection": (bisection, "auto", 1e-7),
    "as published": (bisection, "cg_marschall", 1e-7),
}
LONGER = 20.0

Row = dict[str, Any]


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/minimisers")
    add = found.add_argument
    add("--n", type=int, default=256, help="particles (256)")
    add("--seconds", type=float, default=60.0, help="for each curve (60)")
    add("--states", nargs="+", default=["0.01", "1", "4", "20", "mixture"],
        help="aspect ratios, 'mixture', or packings, *.h5 (0.01 1 4 20 mixture)")  # fmt: skip
    add("--targets", nargs="*", default=list(TARGETS), choices=list(TARGETS), help="(all)")
    return found


def mixture() -> Particles:
    """Discs and rods up to alpha = 8, in two sizes."""
    sizes = [(alpha, size) for alpha in (0.0, 0.3, 1.0, 2.0, 4.0, 8.0) for size in (1.0, 1.4)]
    return Particles.mixture(DEFAULT, [Kind({"alpha": alpha}, size) for alpha, size in sizes])


def recipe_of(name: str, options: Namespace) -> Recipe:
    """Say what a state is made of."""
    is_mixture = name == "mixture"
    return recipe_for(
        mixture() if is_mixture else Particles.of(alpha=float(name)),
        n=options.n,
        phi_start=0.2 if not is_mixture and float(name) > 10 else 0.35,
        tolerance=1e-7,
    )


def state_of(name: str, options: Namespace) -> Packing:
    """Make the packing at u0, or read it."""
    if name.endswith(".h5"):
        return read_packing(name)
    path: Path = options.out / f"state_{name}.h5"
    if name != "mixture" and 0 < float(name) < NEARLY_ROUND:
        return from_discs(state_of("0", options), float(name), path)
    if not is_done(path):
        with tqdm(desc=f"state {name}", unit="row", mininterval=5) as bar:
            make(recipe_of(name, options), path, How(tell=lambda _: bar.update()))
    return read_packing(path)


def from_discs(discs: Packing, alpha: float, path: Path) -> Packing:
    """Make the packing of nearly round rods, or read it."""
    if not is_done(path):
        rods = with_spines(discs, alpha, seed=1)
        landscape = Landscape(rods)
        write_minimum(path, landscape, find(landscape, State.of(rods), Target(tolerance=1e-7)), {})
    return read_packing(path)


def curve(history: History, busy: float) -> Row:
    """Summarise a history: best residual so far against time, thinned, and seconds to each level.

    Of the seconds of the clock the processor was busy for a part, as if it were the same all the time.
    """
    seconds, best = busy * np.array(history.wall_seconds), np.minimum.accumulate(history.residual)
    reached = {f"{level:g}": seconds[best <= level] for level in LEVELS}
    keep = np.flatnonzero(np.diff(best, prepend=np.inf) < 0)
    return {
        "seconds": seconds[keep].tolist(),
        "residual": best[keep].tolist(),
        "to": {k: float(v[0]) if len(v) else None for k, v in reached.items()},
        "reached": float(best[-1]),
    }


def run_minimiser(method: str, packing: Packing, seconds: float) -> Row:
    """Minimise from the displaced state."""
    landscape = Landscape(packing)
    rng = np.random.default_rng(1)
    step = DISPLACEMENT * float(landscape.inner_radius.min()) * rng.normal(size=landscape.size)
    start = landscape.displaced(State.of(packing), step)
    began, busy = time.perf_counter(), time.process_time()
    found = minimise(landscape, start, MINIMISERS[method], Stop(seconds=seconds))
    part = (time.process_time() - busy) / (time.perf_counter() - began)
    return {"outcome": found.outcome.value, **curve(found.history, part)}


def run_target(name: str, packing: Packing, seconds: float) -> Row:
    """Find u0 from the compressed state."""
    search, method, tolerance = TARGETS[name]
    landscape, state = Landscape(packing), State.of(packing)
    u0 = landscape.evaluate(state).energy / state.volume
    target = Target(u0=float(f"{u0:.3g}"), tolerance=tolerance, step=STRAIN, method=method)
    at = Search(state.strained(-STRAIN), target.step)
    began, busy, outcome = time.perf_counter(), time.process_time(), "out of time"
    try:
        for _ in search(landscape, at, target):
            if at.minimum is not None:
                outcome = "found"
            elif time.perf_counter() - began > seconds:
                break
    except TargetError as error:
        outcome = str(error)
    seconds = time.process_time() - busy
    u, residual = at.history.energy_density[-1], at.history.residual[-1]
    if at.minimum is not None:  # the best one, not the last one
        u, residual = at.minimum.energy_density, at.minimum.residual.largest
    off = abs(u / target.u0 - 1)
    return {"outcome": outcome, "seconds": seconds, "off": off, "residual": residual}


def study(options: Namespace) -> dict[str, Row]:
    """Run everything; results of each state are kept in the folder as they come."""
    results: dict[str, Row] = {}
    for name in options.states:
        path = options.out / f"result_{Path(name).stem if name.endswith('.h5') else name}.json"
        found: Row = {"minimisers": {}, "targets": {}}
        if path.exists():
            found = json.loads(path.read_text())
        runs: list[tuple[str, str, Callable[..., Row], float]] = [
            *(("minimisers", m, run_minimiser, options.seconds) for m in MINIMISERS),
            *(("targets", t, run_target, LONGER * options.seconds) for t in options.targets),
        ]
        packing = state_of(name, options)
        for group, method, measure, seconds in runs:
            if method not in found[group]:
                found[group][method] = measure(method, packing, seconds)
                store(path, json.dumps(found).encode())
        results[name] = found | {"n": packing.n}
    return results


def draw(results: dict[str, Row], path: Path) -> None:
    """One panel a state, one curve a minimiser."""
    figure = figure_of(3 * len(results), 3)
    axes = figure.subplots(1, len(results), squeeze=False)[0]
    for axis, (name, result) in zip(axes, results.items(), strict=True):
        for method, row in result["minimisers"].items():
            axis.loglog(row["seconds"], row["residual"], label=method)
        number = name.replace(".", "", 1).isdecimal()
        label = rf"$\alpha = {name}$" if number else Path(name).stem
        axis.set(xlabel="core seconds", ylim=(1e-11, None))
        axis.set_title(f"{label}, $N$ = {result['n']}", fontsize=9)
    axes[0].set_ylabel("largest net force / mean bond force")
    axes[0].legend(fontsize="small")
    save_figure(figure, path)


def cells(name: str, result: Row) -> Iterator[tuple[str, ...]]:
    """Rows of the table for one state: seconds to each level, or what was reached."""
    for method, row in result["minimisers"].items():
        times = [f"{t:.3g} s" if t is not None else "-" for t in row["to"].values()]
        yield (name, method, *times, f"{row['reached']:.1e}")
    shortest = result["targets"].get("extrapolation to 1e-4", {"seconds": math.nan})["seconds"]
    for method, row in result["targets"].items():
        ratio = f"{row['seconds'] / shortest:.3g} times extrapolation to 1e-4"
        outcome = f"{row['outcome']}, u off by {row['off']:.1e}"
        numbers = (f"{row['seconds']:.3g} s", ratio, outcome, f"{row['residual']:.1e}")
        yield (name, f"target, {method}", *numbers)


def main(options: Namespace) -> None:
    """Study, draw, print."""
    options.out.mkdir(parents=True, exist_ok=True)
    results = study(options)
    draw(results, options.out / "minimisers.png")
    heads = ("state", "method", *(f"to {level:g}" for level in LEVELS), "reached")
    print(markdown(heads, [row for name, found in results.items() for row in cells(name, found)]))
    curves = [
        {
            "name": f"{method}, {Path(name).stem}",
            "seconds": row["seconds"],
            "error": row["residual"],
        }
        for name, result in results.items()
        for method, row in result["minimisers"].items()
    ]
    of = {"n": options.n, "states": options.states}
    report({"out": options.out / "minimisers.png", **of, "curves": curves})


if __name__ == "__main__":
    run(parser(), main)
