"""Error of Heun's method against run time: the time step from 1e-3 to the stability limit.

    python analysis/errors/heun_error.py --out runs/heun_error

One state of N = 256 rods (alpha = 4) just below jamming is compressed at kappa = 1e-4 through jamming
with each time step; errors are against a run with a far smaller one. Writes a table (Markdown), a
picture and the numbers (JSON); finished runs are kept and not repeated. The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from argparse import SUPPRESS, ArgumentParser, Namespace
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

ALPHA, KAPPA = 4.0, 1e-4
PHI_START, PHI_FROM, PHI_TO = 0.4, 0.84, 0.88
INTERVAL = 6.0  # time between samples, a multiple of every time step below
STEPS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0)
REFERENCE = 0.00025
SIDES = {1: "one", 2: "two"}
NAMED = (0.001, 0.01, 0.1, 0.6)  # time steps that the picture names


class Row(NamedTuple):
    """Relative errors of the pressure, and of positions over the largest overlap."""

    dt: float
    sides: int
    evaluations: float
    wall_seconds: float
    median: float
    largest: float
    position: float
    dt_limit: float


def start_state(folder: Path, n: int) -> Packing:
    """Make the state that every run starts from, once."""

    def make() -> Packing:
        start = random_packing(n, PHI_START, 1, Particles.of(alpha=ALPHA))
        return compressed(start, Compression(kappa=KAPPA, phi_end=PHI_FROM))

    return kept_packing(folder / f"start_{n}.h5", make)


def run_with(start: Packing, dt: float, sides: int) -> dict[str, Any]:
    """Pressures at the sample times, the end state, the cost and the stability limit met."""
    every = round(INTERVAL / dt)
    pressures, limits = [], []
    with Session() as session:
        compression = CompressionRun(
            session, Compression(kappa=KAPPA, phi_end=PHI_TO, dt=dt, sides=sides), start
        )
        began = time.perf_counter()
        for k in range(1, round(compression.last_step * dt / INTERVAL) + 1):
            compression.advance(k * every)
            sample = compression.measure()
            pressures.append(sample["pressure"])
            limits.append(sample["dt_max"])
        wall = time.perf_counter() - began
        return {
            "dt": dt, "sides": sides, "wall_seconds": wall, "pressure": pressures,
            "evaluations": sample["evaluations"], "dt_limit": min(limits),
            "overlap": sample["overlap"], "position": compression.packing().position.tolist(),
        }  # fmt: skip


class RefusedError(Exception):
    """The fix refused the time step."""


def run_alone(folder: Path, n: int, dt: float, sides: int) -> dict[str, Any]:
    """Run in a process of its own, which Debian's LAMMPS ends on an error."""
    command = [sys.executable, __file__, "--one", str(dt), str(sides), "--n", str(n)]
    done = subprocess.run(
        [*command, "--out", str(folder)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RefusedError
    return dict(json.loads(done.stdout.splitlines()[-1]))


def errors(found: dict[str, Any], reference: dict[str, Any]) -> Row:
    """Compare a run with the reference."""
    p, exact = np.array(found["pressure"]), np.array(reference["pressure"])
    relative = np.abs(p - exact)[exact > 0] / exact[exact > 0]
    moved = np.array(found["position"]) - np.array(reference["position"])
    moved -= np.median(moved, axis=0)
    size = float(np.median(np.linalg.norm(moved, axis=1)))
    same = {name: found[name] for name in ("dt", "sides", "evaluations", "wall_seconds")}
    return Row(
        **same,
        median=float(np.median(relative)),
        largest=float(relative.max()),
        position=size / reference["overlap"],
        dt_limit=found["dt_limit"],
    )


def table(rows: list[Row], refused: list[tuple[float, int]]) -> str:
    """Write the rows as Markdown."""
    heads = ("sides", "dt", "evaluations", "seconds", "p: median error", "p: largest error", "positions")  # fmt: skip
    cells = [
        (SIDES[r.sides], f"{r.dt:g}", f"{r.evaluations:.3g}", f"{r.wall_seconds:.2g}",
         f"{r.median:.1e}", f"{r.largest:.1e}", f"{r.position:.1e}")
        for r in rows
    ]  # fmt: skip
    past = "refused: above the stability limit"
    cells += [(SIDES[sides], f"{dt:g}", past, "", "", "", "") for dt, sides in refused]
    return markdown(heads, cells)


def draw(rows: list[Row], n: int, path: Path) -> None:
    """Errors against wall time."""
    title = rf"rods, $\alpha$ = {ALPHA:g}, $N$ = {n}, $\kappa$ = {KAPPA:g}"
    figure = figure_of(9, 4.2, title)
    axes = figure.subplots(1, 2, sharey=True)
    for (sides, word), axis in zip(SIDES.items(), axes, strict=True):
        of = [r for r in rows if r.sides == sides]
        wall = [r.wall_seconds for r in of]
        axis.margins(x=0.15, y=0.1)  # room for the words at points
        axis.loglog(wall, [r.median for r in of], "o-", label="pressure, median")
        axis.loglog(wall, [r.largest for r in of], "s--", label="pressure, largest")
        for r in of:
            if r.dt in NAMED:
                axis.annotate(f"dt = {r.dt:g}", (r.wall_seconds, r.median), fontsize=7,
                              textcoords="offset points", xytext=(-4, -14), ha="right")  # fmt: skip
        axis.set(xlabel="run time (s)", title=f"sides {word}")
        axis.grid(visible=True, alpha=0.3)
    axes[0].set_ylabel("relative error of p")
    axes[1].legend(loc="center right")
    save_figure(figure, path)


def measured(folder: Path, n: int) -> tuple[list[Row], list[tuple[float, int]]]:
    """Run what is not there; errors, and time steps that were refused."""
    rows, refused = [], []

    def of(dt: float, sides: int) -> dict[str, Any]:
        path = folder / f"sides{sides}_dt{dt:g}_n{n}.json"
        return kept(path, run_alone, folder, n, dt, sides)

    for sides, word in SIDES.items():
        reference = of(REFERENCE, sides)
        for dt in tqdm(STEPS, desc=f"sides {word}", unit="run"):
            try:
                rows.append(errors(of(dt, sides), reference))
            except RefusedError:
                refused.append((dt, sides))
    return rows, refused


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/heun_error")
    found.add_argument("--n", type=int, default=256, help="particles (256)")
    found.add_argument("--one", nargs=2, help=SUPPRESS)
    return found


def main(options: Namespace) -> None:
    """Measure, draw, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    start = start_state(options.out, options.n)
    if options.one:
        report(run_with(start, float(options.one[0]), int(options.one[1])))
        return
    rows, refused = measured(options.out, options.n)
    text = table(rows, refused)
    (options.out / "heun_error.md").write_text(text)
    draw(rows, options.n, options.out / "heun_error.png")
    print(text)
    points = [Point(f"sides {SIDES[r.sides]}", r.wall_seconds, r.median) for r in rows]
    of = {"alpha": ALPHA, "n": options.n, "kappa": KAPPA}
    limit = min(r.dt_limit for r in rows)
    report(
        {"out": options.out, **of, "dt_limit": limit, "refused": refused, "curves": curves(points)}
    )


if __name__ == "__main__":
    run(parser(), main)
