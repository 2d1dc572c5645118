"""Residual force against run time of every minimiser, and of both energy targets, on the same states.

    python analysis/minimiser_error.py --n 256 --seconds 60 --out runs/minimisers
    python analysis/minimiser_error.py --states runs/sweep3d/p1_w0.6_1_seed1.h5 --out runs/minimisers3d

States may also be packings of make_packing.py, superellipsoids as well. For every other state a packing at u0 = 1e-15 is made first (kept in the folder, and taken from there the next
time); nearly round rods start from jammed discs, given spines of random directions. All minimisers then start from it, each particle displaced at random by 1e-6 of its radius, which
is many overlaps; the two energy targets start from it compressed by a strain of 1e-6. A curve is the best residual so
far; the table gives the seconds to residuals of 1e-4, 1e-6 and 1e-8, or what was reached, and how many times
as long as the direct search the paper's takes, with our minimiser and as published.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from singular_limit import with_spines
from tqdm import tqdm

from jamshape.files.h5md import read_packing
from jamshape.landscape import Landscape, State
from jamshape.minima import History, Stop, minimise
from jamshape.minima.target import Search, Target, TargetError, direct, find, halving
from jamshape.packing import Packing
from jamshape.protocols.approach import Approach
from jamshape.protocols.jammed import Sample, is_done, make, write_minimum
from jamshape.protocols.random_start import Mixture

MINIMISERS = ("auto", "newton", "lbfgs", "lammps", "paper")
LEVELS = (1e-4, 1e-6, 1e-8)
DISPLACEMENT = 1e-6
STRAIN = 1e-6
NEARLY_ROUND = 0.1

# Searches for u0 by method and tolerance: the direct one, to the end and to a residual that the published
# algorithm can reach; the paper's; and the paper's with the paper's minimiser. All get this much more time.
TARGETS: dict[str, tuple[Callable[..., Any], str, float]] = {
    "direct": (direct, "auto", 1e-7),
    "direct to 1e-4": (direct, "auto", 1e-4),
    "halving": (halving, "auto", 1e-7),
    "as published": (halving, "paper", 1e-7),
}
LONGER = 20.0

Row = dict[str, Any]


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=256, help="particles (256)")
    parser.add_argument("--seconds", type=float, default=60.0, help="for each curve (60)")
    parser.add_argument("--kappa", type=float, default=4e-6, help="slowest compression rate (4e-6)")
    parser.add_argument(
        "--states",
        nargs="+",
        default=["0.01", "1", "4", "20", "mixture"],
        help="aspect ratios, 'mixture', or packings, *.h5 (0.01 1 4 20 mixture)",
    )
    parser.add_argument("--out", type=Path, required=True, help="folder")
    return parser.parse_args()


def mixture(n: int) -> Mixture:
    """Discs and rods up to alpha = 8, in two sizes."""
    radius = np.where(np.arange(n) % 2, 0.5, 0.7)
    alpha = np.array([0, 0.3, 1, 2, 4, 8])[np.arange(n) // 2 % 6]
    return Mixture.from_arrays(alpha * radius, radius, 1 + (np.arange(n) + 1) % 2)


def state_of(name: str, options: argparse.Namespace) -> Packing:
    """Make the packing at u0, or read it."""
    if name.endswith(".h5"):
        return read_packing(name)
    path: Path = options.out / f"state_{name}.h5"
    if name != "mixture" and 0 < float(name) < NEARLY_ROUND:
        return from_discs(state_of("0", options), float(name), path)
    rods = name != "mixture" and float(name) > 10
    sample = Sample(
        n=options.n,
        alpha=8.0 if name == "mixture" else float(name),
        phi_start=0.2 if rods else 0.35,
        approach=Approach(kappa=options.kappa),
        target=Target(tolerance=1e-7),
        mixture=mixture(options.n) if name == "mixture" else None,
    )
    if not is_done(path):
        for _ in tqdm(make(sample, path), desc=f"state {name}", unit="row", mininterval=5):
            pass
    return read_packing(path)


def from_discs(discs: Packing, alpha: float, path: Path) -> Packing:
    """Make the packing of nearly round rods, or read it."""
    if not is_done(path):
        rods, start = with_spines(discs, alpha, seed=1)
        landscape = Landscape(rods)
        write_minimum(path, landscape, find(landscape, start, Target(tolerance=1e-7)), {})
    return read_packing(path)


def curve(history: History) -> Row:
    """Summarise a history: best residual so far against time, thinned, and seconds to each level."""
    seconds, best = np.array(history.wall_seconds), np.minimum.accumulate(history.residual)
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
    found = minimise(landscape, start, method, Stop(seconds=seconds))
    return {"outcome": found.outcome.value, **curve(found.history)}


def run_target(name: str, packing: Packing, seconds: float) -> Row:
    """Find u0 from the compressed state."""
    search, method, tolerance = TARGETS[name]
    landscape, state = Landscape(packing), State.of(packing)
    u0 = landscape.evaluate(state).energy / state.volume
    target = Target(u0=float(f"{u0:.3g}"), tolerance=tolerance, method=method)
    step = 1e-6 if search is halving else target.step
    run = Search(state.strained(-STRAIN), step)
    began, outcome = time.perf_counter(), "out of time"
    try:
        for _ in search(landscape, run, target):
            if run.minimum is not None:
                outcome = "found"
            elif time.perf_counter() - began > seconds:
                break
    except TargetError as error:
        outcome = str(error)
    seconds = time.perf_counter() - began
    u, residual = run.history.energy_density[-1], run.history.residual[-1]
    if run.minimum is not None:  # the best one, not the last one
        u, residual = run.minimum.energy_density, run.minimum.residual.largest
    off = abs(u / target.u0 - 1)
    return {"outcome": outcome, "seconds": seconds, "off": off, "residual": residual}


def study(options: argparse.Namespace) -> dict[str, Row]:
    """Run everything; results of each state are kept in the folder as they come."""
    results: dict[str, Row] = {}
    for name in options.states:
        path = options.out / f"result_{Path(name).stem if name.endswith('.h5') else name}.json"
        found: Row = {"minimisers": {}, "targets": {}}
        if path.exists():
            found = json.loads(path.read_text())
        runs: list[tuple[str, str, Callable[..., Row], float]] = [
            *(("minimisers", m, run_minimiser, options.seconds) for m in MINIMISERS),
            *(("targets", t, run_target, LONGER * options.seconds) for t in TARGETS),
        ]
        for group, method, run, seconds in runs:
            if method not in found[group]:
                found[group][method] = run(method, state_of(name, options), seconds)
                path.write_text(json.dumps(found))
        results[name] = found
    return results


def draw(results: dict[str, Row], path: Path) -> None:
    """One panel a state, one curve a minimiser."""
    figure, axes = plt.subplots(1, len(results), figsize=(3 * len(results), 3), squeeze=False)
    for axis, (name, result) in zip(axes[0], results.items(), strict=True):
        for method, row in result["minimisers"].items():
            axis.loglog(row["seconds"], row["residual"], label=method)
        number = name.replace(".", "", 1).isdecimal()
        label = rf"$\alpha = {name}$" if number else Path(name).stem
        axis.set(xlabel=f"seconds, {label}", ylim=(1e-11, None))
    axes[0][0].set_ylabel("largest net force / mean bond force")
    axes[0][0].legend(fontsize="small")
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def table(results: dict[str, Row]) -> str:
    """Seconds to each level, as Markdown."""
    heads = [f"to {level:g}" for level in LEVELS]
    lines = [
        f"| state | method | {' | '.join(heads)} | reached |",
        "| --- " * (3 + len(heads)) + "|",
    ]
    for name, result in results.items():
        for method, row in result["minimisers"].items():
            times = [f"{t:.3g} s" if t is not None else "-" for t in row["to"].values()]
            lines.append(f"| {name} | {method} | {' | '.join(times)} | {row['reached']:.1e} |")
        direct_seconds = result["targets"]["direct to 1e-4"]["seconds"]
        for method, row in result["targets"].items():
            ratio = f"{row['seconds'] / direct_seconds:.3g} times direct to 1e-4"
            off = f"u off by {row['off']:.1e}"
            cells = (f"{row['seconds']:.3g} s", ratio, f"{row['outcome']}, {off}")
            line = " | ".join((name, f"target, {method}", *cells, f"{row['residual']:.1e}"))
            lines.append(f"| {line} |")
    return "\n".join(lines)


def main(options: argparse.Namespace) -> None:
    """Study, draw, print."""
    options.out.mkdir(parents=True, exist_ok=True)
    results = study(options)
    draw(results, options.out / "minimisers.png")
    print(table(results))
    curves = [
        {
            "name": f"{method}, {Path(name).stem}",
            "seconds": row["seconds"],
            "error": row["residual"],
        }
        for name, result in results.items()
        for method, row in result["minimisers"].items()
    ]
    found = {"out": str(options.out / "minimisers.png"), "n": options.n, "curves": curves}
    print(json.dumps(found))


if __name__ == "__main__":
    try:
        main(parse())
    except (ValueError, OSError, RuntimeError) as error:
        sys.exit(f"minimiser_error.py: {error}")
