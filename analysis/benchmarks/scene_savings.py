"""Savings by skipped work: paired timings with each shortcut disabled.

    python analysis/benchmarks/scene_savings.py --out runs/scene_savings
    python analysis/benchmarks/scene_savings.py --quick

Two instances of LAMMPS hold the same state, one as it is, one with something turned back on that the scene
does not need (`pair_style ... disable_shortcuts WHAT`, a fix that asks for energy and virial every step, the plane in
a box of three dimensions). They take turns in one process; the cost is the median over the turns of the
ratio of their processor times, with its quartiles. Differences are of the forces, after as many steps,
over the largest force. A `step` is one of fix overdamped/affine with heun, a `force` an evaluation on a
kept list. Second derivatives are those of the Python bindings, beside forces of the same.

Writes scene_savings.md and .csv; the last line of standard output is one JSON object. The exit code is 0
only if all differences are rounding.
"""

from __future__ import annotations

import csv
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.files.h5md import read_packing, write_packing
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.packing import Box, Packing, State
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction

KEPT, CHECKED = "delay 2000000000 every 1 check no", "delay 0 every 1 check yes"
TALLY = """compute virial all pressure NULL virial
           fix tally all ave/time 1 1 1 c_thermo_pe c_virial"""
# Sums in another order, over the largest force.
ROUNDING = 1e-11


class Scene(NamedTuple):
    """Recipe of a state: particles, compressed from a dilute start."""

    particles: Particles
    dimension: int
    phi_start: float
    settings: Compression


FLOW = "fix flow all overdamped/affine drag 1 compress 1e-4\ntimestep 0.05"
SCENES = {
    "discs": Scene(Particles.of(alpha=0.0), 2, 0.4, Compression(kappa=1e-3, phi_end=0.86, dt=0.1)),
    "rods": Scene(Particles.of(alpha=4.0), 2, 0.4, Compression(kappa=1e-3, phi_end=0.86, dt=0.1)),
    "dimers": Scene(Particles.of("dimer"), 2, 0.4, Compression(kappa=1e-3, phi_end=0.86, dt=0.1)),
    "spheres": Scene(
        Particles.of("superellipsoid"), 3, 0.3, Compression(kappa=2e-3, phi_end=0.66, dt=0.5)
    ),
    "spheroids": Scene(
        Particles.of("superellipsoid", w2=1.5),
        3,
        0.3,
        Compression(kappa=2e-3, phi_end=0.72, dt=0.5),
    ),
}


class Case(NamedTuple):
    """Work that a run skips, and the way to disable the shortcut."""

    scene: str
    what: str
    measure: str
    general: str = ""
    more: str = ""
    is_lifted: bool = False


class Row(NamedTuple):
    """Result of one case."""

    scene: str
    left_out: str
    per: str
    cost: float
    low: float
    high: float
    difference: float


SEARCH, ALL = "search", "all of them but the plane"
PAIRS = "pairs out of reach"
CASES = [
    Case("discs", "energy and virial", "step", more=TALLY),
    Case("discs", "rotation", "step", general="rotation"),
    Case("discs", SEARCH, "force", general="contact"),
    Case("discs", PAIRS, "force", general="pairs"),
    Case("discs", "third dimension", "force", is_lifted=True),
    Case("discs", ALL, "step", general="rotation contact pairs", more=TALLY),
    Case("rods", "energy and virial", "step", more=TALLY),
    Case("rods", PAIRS, "force", general="pairs"),
    Case("rods", "third dimension", "force", is_lifted=True),
    Case("dimers", "energy and virial", "step", more=TALLY),
    Case("dimers", PAIRS, "force", general="pairs"),
    Case("dimers", "third dimension", "force", is_lifted=True),
    Case("spheres", "rotation", "step", general="rotation"),
    Case("spheres", SEARCH, "force", general="contact"),
    Case("spheres", PAIRS, "force", general="pairs"),
    Case("spheroids", SEARCH, "force", general="contact"),
    Case("spheroids", PAIRS, "force", general="pairs"),
]


def compressed(path: Path, scene: Scene, n: int) -> Packing:
    """Compress to beyond jamming, once."""
    if not path.exists():
        start = random_packing(n, scene.phi_start, 1, scene.particles, scene.dimension)
        with Session() as session:
            compression = CompressionRun(session, scene.settings, start)
            compression.advance(compression.last_step)
            write_packing(path, compression.packing())
    return read_packing(path)


def lifted(flat: Packing) -> Packing:
    """Return the same state in space: a plane of a box so thick that images are out of reach."""
    edges = np.append(flat.box.edges, 8 * flat.diameters.max())
    zero = np.zeros(flat.n)
    return Packing(
        position=np.column_stack([flat.position, zero]),
        orientation=flat.quaternions,
        diameters=flat.diameters,
        form=flat.form,
        species=flat.species,
        id=flat.id,
        box=Box(np.append(flat.box.lo, -edges[2] / 2), edges),
        shape_style=flat.shape_style,
    )


def states(folder: Path, n: int) -> dict[str, Packing]:
    """Make the states; half as many particles in space."""
    found = {}
    for name, scene in SCENES.items():
        size = n if scene.dimension == 2 else n // 2
        found[name] = compressed(folder / f"{name}_{size}.h5", scene, size)
    return found


def opened(stack: ExitStack, packing: Packing, case: Case, *, is_general: bool) -> Session:
    """Open an instance of LAMMPS that holds the state, as it is or with something turned back on."""
    if is_general and case.is_lifted:
        packing = lifted(packing)
    session = stack.enter_context(Session())
    session.load(packing)
    general = f" disable_shortcuts {case.general}" if is_general and case.general else ""
    style = packing.shape.style(packing, Interaction(1.0, 1)).commands.replace(
        "\n", f"{general}\n", 1
    )
    session.commands(f"""
        {style}
        neighbor 0.3 bin
        neigh_modify {KEPT if case.measure == "force" else CHECKED} one 10000 page 1000000
        {FLOW if case.measure == "step" else ""}
        thermo_style custom step
        thermo_modify norm no lost error
        {case.more if is_general else ""}
        run 0 post no""")
    return session


def forces(session: Session) -> FloatArray:
    """(N, 6) forces and torques, by ID."""
    names = ("f", "torque")
    return np.hstack([np.reshape(session.lmp.gather(name, 1, 3), (-1, 3)) for name in names])


def seconds(work: Callable[[], object]) -> float:
    """Processor time."""
    began = time.process_time()
    work()
    return time.process_time() - began


def ratios(
    plain: Callable[[], object], general: Callable[[], object], rounds: int
) -> tuple[float, float, float]:
    """Median and quartiles of general over plain, which take turns in changing order."""
    found = []
    for turn in range(rounds):
        if turn % 2:
            first = seconds(general)
            found.append(first / seconds(plain))
        else:
            first = seconds(plain)
            found.append(seconds(general) / first)
    low, middle, high = np.quantile(found, [0.25, 0.5, 0.75])
    return float(middle), float(low), float(high)


def advance(session: Session, steps: int) -> None:
    """Take some steps without setting up anew."""
    session.commands(f"run {steps} pre no post no")


def measured(packing: Packing, case: Case, options: Namespace) -> Row:
    """Turn one thing back on."""
    with ExitStack() as stack:
        plain, general = (opened(stack, packing, case, is_general=x) for x in (False, True))
        trial = seconds(partial(advance, plain, 20)) / 20
        steps = max(1, int(options.seconds / trial))
        advance(general, 20)
        cost = ratios(
            partial(advance, plain, steps), partial(advance, general, steps), options.rounds
        )
        a, b = forces(plain), forces(general)
        share = [x for x in plain.left_out().split(", ") if "listed pairs" in x]
    what = f"{case.what} ({share[0]})" if case.what == PAIRS and share else case.what
    return Row(case.scene, what, case.measure, *cost, float(np.abs(a - b).max() / np.abs(a).max()))


def second_derivatives(packing: Packing, options: Namespace) -> Row:
    """Evaluate all second derivatives beside the forces, in Python."""
    landscape, state = Landscape(packing, sides=1), State.of(packing)

    def plain() -> FloatArray:
        return landscape.evaluate(state, extended=False).gradient

    def general() -> FloatArray:
        plain()
        found = landscape.derivatives(state)
        total = np.zeros((packing.n, 2))
        for side, sign in ((0, -1.0), (1, 1.0)):
            np.add.at(total, found["particles"][:, side], sign * found["force"])
        return total

    gradient = landscape.components(plain())[:, :2]
    difference = np.abs(general() - gradient).max() / np.abs(gradient).max()
    cost = ratios(plain, general, 5 * options.rounds)
    return Row("rods", "second derivatives", "force", *cost, float(difference))


def table(rows: list[Row]) -> str:
    """Write the rows as Markdown."""
    lines = [
        "| particles | skipped | per | without the shortcut: time ratio (quartiles) | forces differ by |",
        "| --- | --- | --- | --- | --- |",
    ]
    for r in rows:
        cost = f"{r.cost:.3g} ({r.low:.3g} to {r.high:.3g})"
        lines.append(f"| {r.scene} | {r.left_out} | {r.per} | {cost} | {r.difference:.1g} |")
    return "\n".join(lines) + "\n"


def write(rows: list[Row], folder: Path) -> None:
    """Write both tables."""
    (folder / "scene_savings.md").write_text(table(rows))
    with (folder / "scene_savings.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerows([Row._fields, *rows])


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/scene_savings")
    add = found.add_argument
    add("--n", type=int, default=1024, help="particles; half of them in 3D (1024)")
    add("--rounds", type=int, default=11, help="turns of each (11)")
    add("--seconds", type=float, default=0.15, help="of a turn (0.15)")
    add("--quick", action="store_true", help="200 particles, 3 turns of 0.02 s")
    return found


def main(options: Namespace) -> int:
    """Measure all, write, report."""
    if options.quick:
        options.n, options.rounds, options.seconds = 200, 3, 0.02
    options.out.mkdir(parents=True, exist_ok=True)
    packings = states(options.out, options.n)
    rows: list[Row] = []
    for case in tqdm(CASES, unit="case"):
        rows.append(measured(packings[case.scene], case, options))
        write(rows, options.out)
    rows.append(second_derivatives(packings["rods"], options))
    write(rows, options.out)
    print(table(rows))
    differ = [r.left_out for r in rows if not r.difference <= ROUNDING]
    report({"out": options.out, "n": options.n, "rows": rows, "differ": differ})
    return 1 if differ else 0


if __name__ == "__main__":
    run(parser(), main)
