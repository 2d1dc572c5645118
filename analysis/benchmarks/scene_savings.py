"""What a scene leaves out, and what that saves: each turned back on, by paired timings.

    python analysis/scene_savings.py --out runs/scene_savings
    python analysis/scene_savings.py --quick

Two instances of LAMMPS hold the same state, one as it is, one with something turned back on that the scene
does not need (`pair_style ... general WHAT`, a fix that asks for energy and virial every step, the plane in
a box of three dimensions). They take turns in one process; the cost is the median over the turns of the
ratio of their processor times, with its quartiles. Differences are of the forces, after as many steps,
over the largest force. A `step` is one of fix overdamped/affine with heun, a `force` an evaluation on a
kept list. Second derivatives are those of the Python bindings, beside forces of the same.

Writes scene_savings.md and .csv; the last line of standard output is one JSON object. The exit code is 0
only if all differences are rounding.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.files.lammps_text import read_data, write_data
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.packing import Box, Packing
from jamshape.protocols.random_start import Mixture, random_packing

PHI_START, PHI = 0.4, 0.86
PHI_3D = {1.0: 0.66, 1.5: 0.72}  # under the semi-axis w
KEPT, CHECKED = "delay 2000000000 every 1 check no", "delay 0 every 1 check yes"
TALLY = """compute virial all pressure NULL virial
           fix tally all ave/time 1 1 1 c_thermo_pe c_virial"""
# Sums in another order, over the largest force.
ROUNDING = 1e-11


class Scene(NamedTuple):
    """A state on disk and its pair style."""

    path: Path
    dimension: int
    pair: str
    step: str


class Case(NamedTuple):
    """Something that a scene leaves out, and how it is turned back on."""

    scene: str
    what: str
    measure: str
    general: str = ""
    more: str = ""
    is_lifted: bool = False


class Row(NamedTuple):
    """What one case came to."""

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
    Case("spheres", "rotation", "step", general="rotation"),
    Case("spheres", SEARCH, "force", general="contact"),
    Case("spheres", PAIRS, "force", general="pairs"),
    Case("spheroids", SEARCH, "force", general="contact"),
    Case("spheroids", PAIRS, "force", general="pairs"),
]


def compressed(path: Path, alpha: float, n: int) -> Path:
    """Compress rods or discs to beyond jamming, once."""
    if not path.exists():
        settings = Compression(1e-3, PHI, 0.1)
        with Session() as session:
            start = random_packing(n, PHI_START, 1, Mixture.bidisperse(alpha))
            run = CompressionRun(session, settings, start)
            run.advance(run.last_step)
            write_data(path, run.packing())
    return path


def squeezed(path: Path, w: float, n: int) -> Path:
    """Compress spheroids of semi-axes 1, 1, w to beyond jamming, once."""
    if path.exists():
        return path
    half = 0.5 * (4 * np.pi * w * n / (3 * PHI_START)) ** (1 / 3)
    kappa, dt = 2e-3, 0.5
    steps = int(np.log(PHI_3D[w] / PHI_START) / (3 * kappa * dt))
    with Session() as session:
        session.commands(f"""
            units lj
            atom_style ellipsoid
            atom_modify map array
            region box block -{half} {half} -{half} {half} -{half} {half}
            create_box 1 box
            create_atoms 1 random {n} 1 NULL
            set type 1 shape 2 2 {2 * w}
            set type 1 quat/random 1
            pair_style superellipsoid/harmonic
            pair_coeff * * 1
            neighbor 0.3 bin
            neigh_modify every 1 delay 0 check yes one 10000 page 1000000
            min_style cg
            min_modify dmax 0.1 line backtrack
            minimize 0 1e-9 1000 10000
            reset_timestep 0
            fix flow all overdamped/affine drag 1 compress {kappa}
            timestep {dt}
            run {steps}
            write_data {path} nocoeff""")
    return path


def lifted(scene: Scene) -> Scene:
    """Return the same state in space: a plane of a box so thick that images are out of reach."""
    path = scene.path.with_name(f"{scene.path.stem}_3d.data")
    flat = read_data(scene.path, 2)
    edges = np.append(flat.box.edges, 8 * flat.diameters.max())
    half = flat.orientation / 2
    zero = np.zeros(flat.n)
    packing = Packing(
        position=np.column_stack([flat.position, zero]),
        orientation=np.column_stack([np.cos(half), zero, zero, np.sin(half)]),
        diameters=flat.diameters,
        species=flat.species,
        id=flat.id,
        box=Box(np.append(flat.box.lo, -edges[2] / 2), edges),
    )
    write_data(path, packing)
    return scene._replace(path=path, dimension=3)


def scenes(folder: Path, n: int) -> dict[str, Scene]:
    """Make the states."""
    rods = "spherocylinder/harmonic sides one"
    flat = "fix flow all overdamped/affine drag 1 compress 1e-4\ntimestep 0.05"
    found = {
        name: Scene(compressed(folder / f"{name}_{n}.data", alpha, n), 2, rods, flat)
        for name, alpha in (("discs", 0.0), ("rods", 4.0))
    }
    for name, w in (("spheres", 1.0), ("spheroids", 1.5)):
        path = squeezed(folder / f"{name}_{n // 2}.data", w, n // 2)
        found[name] = Scene(path, 3, "superellipsoid/harmonic", flat)
    return found


def opened(stack: ExitStack, scene: Scene, case: Case, *, is_general: bool) -> Session:
    """Open an instance of LAMMPS that holds the state, as it is or with something turned back on."""
    if is_general and case.is_lifted:
        scene = lifted(scene)
    session = stack.enter_context(Session())
    general = f"general {case.general}" if is_general and case.general else ""
    session.commands(f"""
        units lj
        dimension {scene.dimension}
        atom_style ellipsoid
        atom_modify map array
        read_data {scene.path}
        pair_style {scene.pair} {general}
        pair_coeff * * 1
        neighbor 0.3 bin
        neigh_modify {KEPT if case.measure == "force" else CHECKED} one 10000 page 1000000
        {scene.step if case.measure == "step" else ""}
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


def measured(scene: Scene, case: Case, options: argparse.Namespace) -> Row:
    """Turn one thing back on."""
    with ExitStack() as stack:
        plain = opened(stack, scene, case, is_general=False)
        general = opened(stack, scene, case, is_general=True)

        def run(session: Session, steps: int) -> None:
            session.commands(f"run {steps} pre no post no")

        trial, steps = seconds(lambda: run(plain, 20)) / 20, 20
        steps = max(1, int(options.seconds / trial))
        run(general, 20)
        cost = ratios(lambda: run(plain, steps), lambda: run(general, steps), options.rounds)
        a, b = forces(plain), forces(general)
        share = [x for x in plain.left_out().split(", ") if "listed pairs" in x]
    what = f"{case.what} ({share[0]})" if case.what == PAIRS and share else case.what
    return Row(case.scene, what, case.measure, *cost, float(np.abs(a - b).max() / np.abs(a).max()))


def second_derivatives(scene: Scene, options: argparse.Namespace) -> Row:
    """Evaluate all second derivatives beside the forces, in Python."""
    packing = read_data(scene.path, 2)
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
        "| scene | left out | per | turned back on: times as long (quartiles) | forces differ by |",
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


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("runs/scene_savings"), help="folder")
    parser.add_argument("--n", type=int, default=1024, help="particles; half of them in 3D (1024)")
    parser.add_argument("--rounds", type=int, default=11, help="turns of each (11)")
    parser.add_argument("--seconds", type=float, default=0.15, help="of a turn (0.15)")
    parser.add_argument("--quick", action="store_true", help="200 particles, 3 turns of 0.02 s")
    options = parser.parse_args()
    if options.quick:
        options.n, options.rounds, options.seconds = 200, 3, 0.02
    return options


def main() -> int:
    """Measure all, write, report."""
    options = parse()
    options.out.mkdir(parents=True, exist_ok=True)
    states = scenes(options.out, options.n)
    rows: list[Row] = []
    for case in tqdm(CASES, unit="case"):
        rows.append(measured(states[case.scene], case, options))
        write(rows, options.out)
    rows.append(second_derivatives(states["rods"], options))
    write(rows, options.out)
    print(table(rows))
    differ = [r.left_out for r in rows if not r.difference <= ROUNDING]
    found = [r._asdict() for r in rows]
    print(json.dumps({"out": str(options.out), "rows": found, "differ": differ}))
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
