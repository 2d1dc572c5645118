"""Cases of the stability battery: pair style, fix and minimiser in LAMMPS.

What is expected to run runs in this process; what is expected to stop runs in one of its own, since
Debian's LAMMPS ends its process with an error.
"""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from stability_cases import Case
from stability_contacts import HEAVY, RODS
from stability_scenes import (
    EPS,
    all_aspect_ratios,
    deep,
    difference,
    jammed,
    longer_than_the_box,
    oracle,
    own_images,
    rods,
    scaled,
    stack,
)

from jamshape.arrays import FloatArray
from jamshape.contacts import find_contacts, sum_forces
from jamshape.files.lammps_text import write_data
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session, plugin_path
from jamshape.packing import Packing

PAIR, FIX, MINIMIZE = (
    "pair spherocylinder/harmonic",
    "fix overdamped/affine",
    "LAMMPS minimize",
)
PROTOCOL = "compression from Python"

ROOT = Path(__file__).resolve().parents[1]
SKIN = 0.3
SIDES = ("one", "two")

_CROSSING = "crossing spines or coinciding centres, where no contact force exists"
_PAST = r"past the stability limit .* use a timestep below"
_TOO_FAR = "one step moves atom .* expected at most half its radius: use a smaller timestep"


class Frame(NamedTuple):
    """A state in LAMMPS, sorted by ID; quaternions and positions to the last bit."""

    packing: Packing
    quaternion: FloatArray
    force: FloatArray
    torque: FloatArray
    strain: float


def set_up(sides: str = "one", k_e: float = 1.0, skin: float = SKIN) -> str:
    """Input after the data file."""
    return f"""
        pair_style spherocylinder/harmonic sides {sides}
        pair_coeff * * {k_e!r}
{neighbours(skin)}"""


def neighbours(skin: float = SKIN) -> str:
    """Input of the neighbour list."""
    return f"""
        neighbor {skin!r} {"bin" if skin < 30 else "nsq"}
        neigh_modify every 1 delay 0 check yes one 10000 page 1000000"""


_CONTACTS = "\ncompute contacts all contact/local itag bond"
_OUTPUT = "\nthermo_style custom step c_packing[1]\nthermo_modify norm no lost error"


def fix(drag: float = 1.0, kappa: float = 0.0, dt: float = 0.1, options: str = "") -> str:
    """Input of the driven dynamics."""
    return f"fix flow all overdamped/affine drag {drag!r} compress {kappa!r} {options}\ntimestep {dt!r}"


@contextmanager
def loaded(packing: Packing, text: str, newton: str = "on") -> Iterator[Session]:
    """LAMMPS in this process, with a packing and a compute of all it measures."""
    with Session() as session:
        session.commands(f"newton {newton}")
        session.load(packing)
        session.commands(text + "\ncompute packing all packing" + _CONTACTS + _OUTPUT)
        yield session


def frame(session: Session) -> Frame:
    """Read the present state."""
    packing, D = session.packing(), int(session.lmp.extract_setting("dimension"))

    def rows(name: str, width: int) -> FloatArray:
        return np.array(session.lmp.gather(name, 1, width)).reshape(packing.n, width)

    torque = rows("torque", 3)
    return Frame(
        packing=packing,
        quaternion=rows("c_orient", 4),
        force=rows("f", 3)[:, :D],
        torque=torque if D == 3 else torque[:, 2:],
        strain=float(session.lmp.extract_fix("flow", 0, 1, 1)) if _has_fix(session) else 0.0,
    )


def _has_fix(session: Session) -> bool:
    return bool(session.lmp.has_id("fix", "flow"))


def measured(session: Session, column: int) -> float:
    """Element of compute packing, from 1."""
    return float(session.lmp.extract_compute("packing", 0, 1)[column - 1])


def contacts_in(session: Session, *, bonds: bool = False) -> int:
    """Contacts (or bonds) that `compute contact/local` lists."""
    array = session.lmp.numpy.extract_compute("contacts", 2, 2)
    rows = np.reshape(array, (-1, 2))
    return len(rows) if bonds else int((rows[:, 1] == 0).sum())


def sentence(packing: Packing, text: str) -> str:
    """Run in a process of its own: the error it stops with, or that it stops with none."""
    with tempfile.TemporaryDirectory() as folder:
        data, deck = Path(folder) / "start.data", Path(folder) / "case.in"
        write_data(data, packing)
        lines = f"""
            include {ROOT / "inputs" / "load_plugin.lmp"}
            units lj
            dimension {packing.dimension}
            atom_style ellipsoid
            atom_modify map array
            read_data {data}
            {text}"""
        deck.write_text("\n".join(line.strip() for line in lines.strip().splitlines()) + "\n")
        try:
            done = subprocess.run(
                ["lmp", "-nocite", "-log", "none", "-in", str(deck)],
                env=os.environ | {"JAMSHAPE_PLUGIN": str(plugin_path()), "OMP_NUM_THREADS": "1"},
                cwd=folder,
                text=True,
                capture_output=True,
                timeout=60,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return "no sentence in a minute"
    found = re.findall(r"^ERROR(?: on proc \d+)?: (.*)$", done.stdout + done.stderr, re.MULTILINE)
    if done.returncode == 0 or len(found) != 1:
        return f"exit code {done.returncode}, {len(found)} sentences"
    return re.sub(r" \(\S+:\d+\)$", "", found[0])


# --- the pair style ------------------------------------------------------------------------------


def force_error(
    scene: Callable[[], Packing], sides: str, newton: str = "on", k_e: float = 1.0
) -> float:
    """Compare forces with the oracle (one) or the bindings (two), in overlaps; contacts counted."""
    with loaded(scene(), set_up(sides, k_e), newton) as session:
        session.commands("run 0")
        at, bonds = frame(session), contacts_in(session, bonds=sides == "two")
    if not np.isfinite(at.force).all():
        return np.inf
    if sides == "one":
        expected = oracle(at.packing, k_e, at.quaternion)
        lost = bonds != expected.n_contacts
        return np.inf if lost else difference(at.packing, at.force, at.torque, expected, k_e)
    network = find_contacts(at.packing, k_e, 2)
    if bonds != network.n_bonds.sum():
        return np.inf
    other = sum_forces(at.packing, network)
    arm = np.maximum(at.packing.half_length, at.packing.radius)[:, None]
    torque = other.torque.reshape(at.packing.n, -1)
    worst = max(np.abs(at.force - other.force).max(), np.abs((at.torque - torque) / arm).max())
    return float(worst * at.packing.diameters[:, 1].min() / k_e)


def orders_of_k_e(sides: str) -> float:
    """Stiffness from 1e-6 to 1e6 between types of one packing: the pairs' forces one by one."""
    packing, worst = jammed(1.0), 0.0
    types = 1 + np.arange(packing.n) % 2
    packing = packing.with_(species=types)
    values = {(1, 1): 1e-6, (2, 2): 1e6, (1, 2): 1.0}
    text = set_up(sides) + "".join(f"\npair_coeff {i} {j} {k!r}" for (i, j), k in values.items())
    with loaded(packing, text) as session:
        session.commands("run 0")
        at = frame(session)
    network = find_contacts(at.packing, 1.0, SIDES.index(sides) + 1)
    pair_types = np.sort(types[network.pairs], axis=1)
    k = np.array([values[(a, b)] for a, b in pair_types.tolist()])
    expected, sizes = np.zeros_like(at.force), np.zeros(packing.n)
    for which, sign in ((0, 1), (1, -1)):
        np.add.at(expected, network.pairs[:, which], sign * k[:, None] * network.force)
        np.add.at(sizes, network.pairs[:, which], k)
    for row in range(packing.n):
        worst = max(
            worst, float(np.abs(at.force[row] - expected[row]).max() / max(sizes[row], 1e-300))
        )
    return worst


def other_unit(length: float, sides: str) -> float:
    """Give the same packing with all lengths scaled, the skin too: change of forces, in overlaps."""
    found = []
    for factor in (1.0, length):
        packing = scaled(jammed(1.0), factor)
        with loaded(packing, set_up(sides, 1.0, SKIN * factor)) as session:
            session.commands("run 0")
            found.append((frame(session), contacts_in(session)))
    (a, bonds), (b, bonds_there) = found
    if bonds != bonds_there:
        return np.inf
    return float(np.abs(b.force * length - a.force).max())


def overlaps(dimension: int, overlap: float) -> Packing:
    """Pairs of every class of contact, far from each other, with this overlap."""
    A, R = np.array([1.0, 0.6]), np.array([0.5, 0.3])
    d = (1 - overlap) * R.sum()
    rows = [  # angles of i and j, centre of j
        (0.0, 1.0, np.array([0.3, d]) + A[1] * np.array([np.cos(1.0), np.sin(1.0)])),
        (0.7, -0.6, np.array([A[0] * np.cos(0.7) + d + A[1] * np.cos(0.6), A[0] * np.sin(0.7) - A[1] * np.sin(0.6)])),
        (0.0, 0.0, np.array([0.8, d])),
        (0.0, 1e-12, np.array([0.8, d])),
    ]  # fmt: skip
    position, angle = [], []
    for n, (i, j, shift) in enumerate(rows):
        centre = np.array([16.0 * n - 24.0, 0.0])
        position += [centre, centre + shift]
        angle += [i, j]
    half, radius = np.tile(A, 4), np.tile(R, 4)
    if dimension == 2:
        return rods(position, angle, half, radius, [72.0, 16.0])
    turn = np.array(angle) / 2
    q = np.column_stack([np.cos(turn), 0 * turn, 0 * turn, np.sin(turn)])
    return rods(np.pad(position, ((0, 0), (0, 1))), q, half, radius, [72.0, 16.0, 16.0])


def pair_cases() -> list[Case]:
    """List what the pair style must stand."""
    found = []
    judge = {"one": "long double over all images", "two": "bindings"}
    scenes = dict(RODS)
    for dimension in (2, 3):
        for overlap in (1e-14, 1e-11, 1e-8, 1e-4, 1 / 3):
            name = f"{dimension}D, overlap {overlap:.2g}"
            scenes[name] = partial(overlaps, dimension, overlap)
    for name, scene in scenes.items():
        for sides in SIDES:
            for newton in ("on", "off"):
                # Tips are rounded by the length of a rod times EPS, and one bond's lever arm at
                # 1e-14 by nothing else.
                limit = 1e-13 if "100" in name or "longer" in name else 2e-14
                run = partial(force_error, scene, sides, newton)
                what = f"forces against {judge[sides]}, in overlaps"
                label = f"{name}, sides {sides}, newton {newton}"
                if newton == "off" and not name.endswith(("own images", "longer than the box")):
                    continue
                found.append(Case(PAIR, label, what, limit, run))
    for sides in SIDES:
        for k_e in (1e-6, 1e6):
            run = partial(force_error, partial(all_aspect_ratios, 2), sides, "on", k_e)
            label = f"k_e {k_e:g}, sides {sides}"
            found.append(Case(PAIR, label, f"forces against {judge[sides]}", 1e-13, run))
        run = partial(orders_of_k_e, sides)
        label = f"k_e 1e-6, 1 and 1e6 in one box, sides {sides}"
        found.append(Case(PAIR, label, "forces against sums by type, in overlaps", 1e-14, run))
        for length in (1e-6, 1e-3, 1e3, 1e6):
            run = partial(other_unit, length, sides)
            label = f"unit of length {length:g}, sides {sides}"
            found.append(Case(PAIR, label, "change of scaled forces, in overlaps", 1e-13, run))
    two = partial(rods, half_length=1.0, radius=0.5, edges=[12.0, 12.0])
    stops = {
        "crossing spines": two([[0.0, 0.0], [0.1, 0.2]], [0.0, 1.5]),
        "spines crossing by 1e-12": two([[0.0, 0.0], [0.3, 1 - 1e-12]], [0.0, np.pi / 2]),
        "coincident centres": two([[1.0, 1.0], [1.0, 1.0]], 0.3),
        "crossing through the boundary": two([[5.9, 0.0], [-5.9, 0.2]], [0.0, 1.5]),
        "collinear and overlapping": two([[1.0, 1.0], [1.5, 1.0]], 0.0),
        "coincident discs": rods([[1.0, 1.0], [1.0, 1.0]], 0.0, 0.0, 0.5, [12.0, 12.0]),
    }
    for name, packing in stops.items():
        for sides in SIDES if "cross" in name else ("two",):
            run_there = partial(sentence, packing, set_up(sides) + "\nrun 0")
            found.append(Case(PAIR, f"{name}, sides {sides}", "sentence", _CROSSING, run_there))
    # A skin far above the box asks for images beyond counting.
    large = partial(
        lambda: sentence(scaled(jammed(1.0), 1e6), set_up("one", skin=29.0) + "\nrun 0")
    )
    words = "Cannot use neighbor bins - box size << cutoff"
    label = "unit of length 1e6 in a plane of thickness 1, in bins"
    found.append(Case(PAIR, label, "sentence", words, large))
    tiny = partial(lambda: sentence(scaled(jammed(1.0), 1e-6), set_up("one") + "\nrun 0"))
    what = "sentence"
    found.append(
        Case(
            PAIR, "skin 1e5 times the box", what, r"skin|cutoff|neighbor|Neighbor", tiny, heavy=True
        )
    )
    return found


# --- the fix -------------------------------------------------------------------------------------


@cache
def _reference_run(sides: str) -> Frame:
    return _run_at(1.0, 1.0, 1.0, sides)


def _run_at(k_e: float, k_d: float, length: float, sides: str) -> Frame:
    """Drive a jammed packing for a fixed number of steps, in units of its own time."""
    t0 = length**2 * k_d * length**2 / k_e / length**2  # k_d per area, lengths of order `length`
    t0 *= length**2
    packing = scaled(jammed(1.0), length)
    text = set_up(sides, k_e, SKIN * length) + "\n" + fix(k_d, 1e-4 / t0, 0.05 * t0)
    with loaded(packing, text) as session:
        session.commands("run 200")
        return frame(session)


def invariant(k_e: float, k_d: float, length: float, sides: str) -> float:
    """Change of the final poses when units of energy, time and length change."""
    a, b = _reference_run(sides), _run_at(k_e, k_d, length, sides)
    apart = b.packing.position / length - a.packing.position
    edges = a.packing.box.edges
    apart -= edges * np.round(apart / edges)
    turned = np.abs(np.sin(b.packing.orientation - a.packing.orientation)).max()
    return float(max(np.abs(apart).max(), turned, abs(b.strain - a.strain)))


def two_discs(overlap: float = 0.1, edge: float = 20.0) -> Packing:
    """Two discs that overlap: r(t) = d - overlap d exp(-2 k_e t / (k_d d^2 area))."""
    return rods([[0.0, 0.0], [1.0 - overlap, 0.0]], 0.0, 0.0, 0.5, [edge, edge])


_RATE = 2 / (np.pi / 4)  # of the overlap of two_discs, k_e = k_d = d = 1


def relaxation_error(fraction: float, steps: int) -> float:
    """Overlap left after so many steps: distance from Heun's method in closed form over rounding."""
    dt = fraction * 2 / _RATE
    with loaded(two_discs(), set_up() + "\n" + fix(1.0, 0.0, dt)) as session:
        session.commands(f"run {steps}")
        x = frame(session).packing.position
    left = 1 - abs(float(x[1, 0] - x[0, 0]))
    h = _RATE * dt
    # Past half of the limit the first stage parts the discs, and the second has no force.
    a_step = 1 - h + h**2 / 2 if h < 1 else 1 - h / 2
    rounding = steps * EPS  # positions of order 1
    heun_error = 0.1 * abs(a_step**steps - np.exp(-h * steps)) + rounding
    by_heun = abs(left - 0.1 * a_step**steps) / rounding
    return float(max(by_heun, abs(left - 0.1 * np.exp(-h * steps)) / heun_error / 1.01))


def half_steps(sides: str) -> float:
    """Ratio of the errors of two time steps over that of a method of second order, less 1."""
    start, ends = jammed(0.0), []
    for steps in (100, 200, 800):
        with loaded(start, set_up(sides) + "\n" + fix(1.0, 1e-3, 4.0 / steps)) as session:
            session.commands(f"run {steps}")
            ends.append(frame(session).packing.position)
    coarse, fine = (np.abs(end - ends[2]).max() for end in ends[:2])
    return abs(float(coarse / fine) * 15 / 63 - 1)  # the reference has an error too


def lone_particle(kappa: float, dt: float, steps: int) -> float:
    """Box and positions of particles that touch nothing, against the exponential, relative."""
    packing = rods([[3.0, 1.0], [-4.0, -2.0]], [0.3, 1.2], 1.0, 0.5, [20.0, 20.0])
    with loaded(packing, set_up() + "\n" + fix(1.0, kappa, dt)) as session:
        session.commands(f"run {steps}")
        end = frame(session)
    factor = np.exp(-kappa * dt * steps)
    turned = np.abs(np.sin(end.packing.orientation - packing.orientation)).max()
    by_box = np.abs(end.packing.box.edges / (factor * packing.box.edges) - 1).max()
    by_x = np.abs(end.packing.position - factor * packing.position).max() / 4.0
    by_strain = abs(end.strain - kappa * dt * steps) / abs(kappa * dt * steps)
    return float(max(turned, by_box, by_x, by_strain))


def rates_changed(scene: Callable[[], Packing], factor: float) -> float:
    """Kappa changed by this factor from a step to the next and back: strain, box, forces."""
    kappas = [1e-3, 1e-3 / factor, 1e-3, -1e-3 / factor, 1e-3]
    with loaded(scene(), set_up("two") + "\n" + fix(1.0, kappas[0], 0.02)) as session:
        session.commands("run 0")
        strain, edges = 0.0, frame(session).packing.box.edges
        for kappa in kappas:
            for steps in (1, 7):
                session.commands("unfix flow\n" + fix(1.0, kappa, 0.02) + f"\nrun {steps}")
                strain += kappa * 0.02 * steps
        end = frame(session)
    expected = oracle_of_two(end)
    by_box = np.abs(end.packing.box.edges / (edges * np.exp(-strain)) - 1).max()
    return float(max(by_box, expected))


def steps_changed(factor: float) -> float:
    """Change the time step by this factor between steps: box against the strain, and forces."""
    dts = [0.02, 0.02 / factor, 0.02, 0.02 / factor]
    with loaded(jammed(1.0), set_up("two") + "\n" + fix(1.0, 1e-3, 0.02)) as session:
        session.commands("run 0")
        edges, strain = frame(session).packing.box.edges, 0.0
        for dt in dts:
            session.commands(f"timestep {dt!r}\nrun 3")
            strain += 1e-3 * dt * 3
        end = frame(session)
    by_box = np.abs(end.packing.box.edges / (edges * np.exp(-strain)) - 1).max()
    return float(max(by_box, oracle_of_two(end)))


def oracle_of_two(at: Frame) -> float:
    """Difference of forces from the bindings, in overlaps."""
    other = sum_forces(at.packing, find_contacts(at.packing, 1.0, 2))
    if not np.isfinite(at.force).all():
        return np.inf
    return float(np.abs(at.force - other.force).max() * at.packing.diameters[:, 1].min())


def power_balance(kappa: float, sides: str) -> float:
    """dU/dt = 2 kappa p L^2 - dissipation, over one short step, relative to the larger term."""
    dt = 1e-4
    text = set_up(sides) + "\n" + fix(1.0, kappa, dt)
    # Off the kinks of side-to-side contacts, where the energy has no rate.
    packing, rng = jammed(1.0), np.random.default_rng(9)
    packing = packing.with_(orientation=packing.orientation + 0.03 * rng.normal(size=packing.n))
    with loaded(packing, text) as session:
        session.commands("run 3")
        found = []
        for _ in range(3):
            session.commands("run 1")
            volume = float(np.prod(frame(session).packing.box.edges))
            u, p = measured(session, 2), measured(session, 3)
            lost = float(session.lmp.extract_fix("flow", 0, 1, 4))
            found.append((u * volume, 2 * kappa * p * volume - lost, lost))
    rate = (found[2][0] - found[0][0]) / (2 * dt)
    return float(abs(rate - found[1][1]) / found[1][2])


def extreme_run(scene: Callable[[], Packing], sides: str, kappa: float = 1e-4) -> float:
    """After 100 driven steps: finite, no contact lost, forces those of the bindings."""
    with loaded(scene(), set_up(sides) + "\n" + fix(1.0, kappa, 0.02)) as session:
        session.commands("run 100")
        at, bonds = frame(session), contacts_in(session, bonds=True)
    network = find_contacts(at.packing, 1.0, SIDES.index(sides) + 1)
    if not (np.isfinite(at.force).all() and bonds == network.n_bonds.sum()):
        return np.inf
    other = sum_forces(at.packing, network)
    return float(np.abs(at.force - other.force).max() * at.packing.diameters[:, 1].min())


def restarted_in_an_event(sides: str) -> float:
    """Restart where the energy of a driven packing falls fastest, against going on without."""
    steps, kappa, dt = 1000, 3e-5, 0.2
    text = set_up(sides) + "\n" + fix(1.0, kappa, dt)

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "event.restart"
        with loaded(jammed(4.0, 24, 0.8), text) as session:
            session.commands("run 8000")
            energies = []
            for _ in range(40):
                session.commands("run 100 pre no post no")
                energies.append(measured(session, 2))
        falls = np.diff(energies)
        if falls.min() >= 0:
            return np.inf
        event = 8000 + 100 * (1 + int(falls.argmin())) + 50  # in the middle of the fastest fall
        with loaded(jammed(4.0, 24, 0.8), text) as session:
            session.commands(f"run {event}\nwrite_restart {path}")
        with loaded(jammed(4.0, 24, 0.8), text) as session:
            session.commands(f"run {event + steps}")
            whole = frame(session)
        with Session() as session:
            session.load_restart(path)
            lines = text[text.index("neighbor") :]
            session.commands(f"{lines}\ncompute packing all packing{_OUTPUT}\nrun {steps}")
            again = frame(session)
    apart = whole.packing.position - again.packing.position
    edges = whole.packing.box.edges
    apart -= edges * np.round(apart / edges)
    turned = np.abs(np.sin(whole.packing.orientation - again.packing.orientation)).max()
    return float(max(np.abs(apart).max() / edges[0], turned, abs(whole.strain - again.strain)))


def compressed_deep() -> float:
    """Driven from jamming until the deepest overlap is a third: forces in overlaps."""
    text = set_up("two") + "\n" + fix(1.0, 5e-3, 0.02)
    with loaded(jammed(0.0), text) as session:
        session.commands("run 0")
        for _ in range(60):
            session.commands("run 100")
            if measured(session, 12) > 1 / 3:
                return oracle_of_two(frame(session))
    return np.inf


def fix_cases() -> list[Case]:
    """List what the driven dynamics must stand."""
    found = []
    for sides in SIDES:
        for ratio in (1e-6, 1e-3, 1e3, 1e6):
            for k_e, k_d in ((ratio, 1.0), (1.0, 1 / ratio)):
                label = f"k_e/k_d {ratio:g} by k_{'e' if k_d == 1 else 'd'}, sides {sides}"
                run = partial(invariant, k_e, k_d, 1.0, sides)
                found.append(Case(FIX, label, "change of scaled poses", 1e-10, run))
        for length in (1e-6, 1e6):
            run = partial(invariant, 1.0, 1.0, length, sides)
            label = f"unit of length {length:g}, sides {sides}"
            found.append(Case(FIX, label, "change of scaled poses", 1e-10, run))
        for kappa in (1e-3, 1e-10):
            run = partial(power_balance, kappa, sides)
            label = f"power balance, kappa {kappa:g}, sides {sides}"
            found.append(Case(FIX, label, "dU/dt against work and drag", 1e-5, run))
        run = partial(restarted_in_an_event, sides)
        label = f"restart within a plastic event, sides {sides}"
        found.append(Case(FIX, label, "distance from the run without", 1e-12, run))
    for fraction, steps in (
        (1e-12, 1000),
        (1e-6, 1000),
        (1e-3, 1000),
        (0.1, 50),
        (0.5, 20),
        (0.89, 50),
    ):
        run = partial(relaxation_error, fraction, steps)
        label = f"dt {fraction:g} of the limit"
        found.append(Case(FIX, label, "distance from Heun's closed form, over rounding", 1.0, run))
    found.append(
        Case(
            FIX,
            "half the step",
            "ratio of errors over that of second order, less 1",
            0.1,
            partial(half_steps, "one"),
        )
    )
    for factor in (1.05, 10.0, 1e6):
        text = f"{set_up()}\n{fix(1.0, 0.0, factor * 2 / _RATE)}\nrun 10"
        label = f"dt {factor:g} of the limit"
        found.append(Case(FIX, label, "sentence", _PAST, partial(sentence, two_discs(), text)))
    for dt in (10.0, 1e300):
        text = f"{set_up()}\n{fix(1.0, 0.0, dt, 'check 0')}\nrun 10"
        label = f"dt {dt:g}, no check"
        found.append(Case(FIX, label, "sentence", _TOO_FAR, partial(sentence, two_discs(), text)))
    for kappa in (1e-3, 1e-5, 1e-7, 1e-10, -1e-10):
        run = partial(lone_particle, kappa, 0.1, 1000)
        found.append(Case(FIX, f"kappa {kappa:g}", "box, lone particles, relative", 1e-14, run))
    run = partial(lone_particle, 1e-3, 1e-9, 1000)
    found.append(Case(FIX, "kappa 1e-3, dt 1e-9", "box, lone particles, relative", 1e-14, run))
    for kappa in (10.0, 1e3, 1e10):
        # The box would shrink by half, or to nothing, from one step to the next.
        text = f"{set_up()}\n{fix(1.0, kappa, 0.1)}\nrun 10"
        words = r"smaller timestep|use a timestep|smaller rate|compress"
        run_there = partial(sentence, two_discs(0.1), text)
        found.append(Case(FIX, f"kappa {kappa:g}", "sentence", words, run_there))
    changed: dict[str, Callable[[], Packing]] = {
        "jammed": partial(jammed, 1.0),
        "alpha 1e-6 to 100": partial(all_aspect_ratios, 2),
    }
    for name, scene in changed.items():
        for factor in (1e6, 1e-1):
            run = partial(rates_changed, scene, factor)
            label = f"rates changed by {factor:g}, {name}"
            found.append(Case(FIX, label, "box and forces", 1e-12, run))
    found.append(
        Case(FIX, "dt changed by 1e6", "box and forces", 1e-12, partial(steps_changed, 1e6))
    )
    scenes: dict[str, Callable[[], Packing]] = {
        "alpha 1e-6 to 100 in one box": partial(all_aspect_ratios, 2),
        "longer than the box": longer_than_the_box,
        "own images": partial(own_images, 2),
        "3D, own images": partial(own_images, 3),
        "overlaps of a third": partial(deep, 2),
        "3D, overlaps of a third": partial(deep, 3),
        **{f"stack to {a:g}": partial(stack, a, 2) for a in (1e-6, 1e-9, 1e-14)},
        **{f"3D, stack to {a:g}": partial(stack, a, 3) for a in (1e-6, 1e-14)},
    }
    for name, scene in scenes.items():
        for sides in SIDES:
            run = partial(extreme_run, scene, sides)
            what = "forces after 100 steps, in overlaps"
            limit = 1e-12 if "100" in name or "longer" in name else 2e-13
            found.append(Case(FIX, f"{name}, sides {sides}", what, limit, run))
    found.append(
        Case(
            FIX, "compressed to overlaps of a third", "forces, in overlaps", 1e-14, compressed_deep
        )
    )
    cross = f"{set_up()}\n{fix(1.0, 5e-2, 0.02, 'check 0')}\nrun 100000"
    run_there = partial(lambda text: sentence(jammed(1.0), text), cross)
    what = "sentence"
    found.append(
        Case(FIX, "compressed until spines cross", what, f"{_CROSSING}|{_TOO_FAR}", run_there)
    )
    return found


# --- minimize and the library --------------------------------------------------------------------


def minimised(scene: Callable[[], Packing], style: str, line: str = "quadratic") -> float:
    """Energy after 50 iterations over that before."""
    style_of_search = f"min_style {style}\nmin_modify dmax 0.1 line {line}"
    with loaded(scene(), set_up("two") + f"\n{style_of_search}") as session:
        session.commands("run 0")
        before = measured(session, 2)
        session.commands("minimize 0 1e-300 50 500\nrun 0")
        after, at = measured(session, 2), frame(session)
    return np.inf if not np.isfinite(at.force).all() else after / before


def compression_in_units(length: float, k_e: float) -> float:
    """`CompressionRun` in other units: phi it stops at, and pressure, against that in units of 2R."""
    found = []
    for unit, energy in ((1.0, 1.0), (length, k_e)):
        t0 = unit**4 / energy  # k_d = 1 in all
        packing = scaled(jammed(0.0, 16, 0.8), unit)
        with Session() as session:
            settings = Compression(kappa=1e-3 / t0, phi_end=0.9, dt=0.1 * t0, k_e=energy)
            run = CompressionRun(session, settings, packing)
            run.advance(run.last_step)
            at = run.measure()
            found.append((at["phi"], at["p"] * unit**2 / energy))
    (phi, p), (phi_there, p_there) = found
    return max(abs(phi_there / phi - 1), abs(p_there / p - 1))


def library_cases() -> list[Case]:
    """LAMMPS's minimize with our pair style, and compressions from Python."""
    found = []
    scenes: dict[str, Callable[[], Packing]] = {
        "alpha 1e-6 to 100 in one box": partial(all_aspect_ratios, 2),
        "own images": partial(own_images, 2),
        "3D, own images": partial(own_images, 3),
        "overlaps of a third": partial(deep, 2),
        "stack to 1e-12": partial(stack, 1e-12, 2),
    }
    for name, scene in scenes.items():
        for style in ("cg", "sd"):
            for line in ("quadratic", "backtrack"):
                run = partial(minimised, scene, style, line)
                # The deep one has been minimised before; all others must gain.
                limit = 1.0 if "third" in name else 0.99
                label = f"{name}, {style}, line {line}"
                found.append(Case(MINIMIZE, label, "energy over that before", limit, run))
    for length, k_e in ((1e-3, 1.0), (1e3, 1.0), (1.0, 1e-6), (1.0, 1e6)):
        run = partial(compression_in_units, length, k_e)
        label = f"length {length:g}, k_e {k_e:g}"
        found.append(Case(PROTOCOL, label, "change of scaled p and of phi", 1e-8, run))
    return found


def cases() -> list[Case]:
    """All of them."""
    found = [*pair_cases(), *fix_cases(), *library_cases()]
    return [replace(case, heavy=case.heavy or HEAVY in case.name) for case in found]
