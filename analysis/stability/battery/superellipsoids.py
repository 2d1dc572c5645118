"""Cases of the stability battery: superellipsoids in LAMMPS, and LAMMPS on two ranks."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from stability_cases import Case
from stability_contacts import EXPONENTS
from stability_lammps import (
    ROOT,
    SKIN,
    Frame,
    contacts_in,
    fix,
    frame,
    loaded,
    measured,
    neighbours,
    sentence,
)
from stability_lammps import set_up as set_up_of_rods
from stability_scenes import EPS, all_aspect_ratios, jammed, own_images, scaled
from stability_shapes import (
    SCENES,
    crowd,
    difference,
    pair_commands,
    particles,
    sums,
    tiny_box,
)

from jamshape import _contact
from jamshape.arrays import FloatArray
from jamshape.contacts import superellipsoid_bodies
from jamshape.files.lammps_text import write_data
from jamshape.lammps.session import Session, plugin_path
from jamshape.packing import Packing

PAIR, FIX, RANKS = (
    "pair superellipsoid/harmonic",
    "fix overdamped/affine, superellipsoids",
    "two ranks",
)

# Flat faces and sharp tips magnify rounding: as `superellipsoids` of `stability_contacts`.
_FORCES = 1e-12

_COINCIDING = "coinciding centres, where no contact force exists"
_PAST = r"past the stability limit .* use a timestep below"

UNITS = ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6))


def set_up(packing: Packing, k_e: float = 1.0, skin: float = SKIN) -> str:
    """Input after the data file."""
    return pair_commands(packing, k_e) + neighbours(skin)


def seen(session: Session, like: Packing) -> Frame:
    """Read the present state of these particles: LAMMPS knows exponents by type only."""
    at = frame(session)
    packing = at.packing.with_(shape_style="superellipsoid", exponent=like.exponent)
    return at._replace(packing=packing)


def error_of(at: Frame, k_e: float = 1.0) -> float:
    """Difference from the bindings; infinite where a number is not finite."""
    fine = np.isfinite(at.force).all() and np.isfinite(at.torque).all()
    return difference(at.packing, at.force, at.torque, k_e) if fine else np.inf


def apart(a: Frame, b: Frame, unit: float = 1.0) -> float:
    """Largest distance over the box edge, and difference of quaternions, of two states."""
    edges = a.packing.box.edges
    shift = b.packing.position / unit - a.packing.position
    shift -= edges * np.round(shift / edges)
    turned = [np.abs(b.quaternion - sign * a.quaternion).max(axis=1) for sign in (1, -1)]
    return float(max((np.abs(shift) / edges).max(), np.minimum(*turned).max()))


# --- the pair style ------------------------------------------------------------------------------


def force_error(scene: Callable[[], Packing], k_e: float = 1.0, newton: str = "on") -> float:
    """Compare forces with the bindings; contacts counted."""
    packing = scene()
    with loaded(packing, set_up(packing, k_e), newton) as session:
        session.commands("run 0")
        at, bonds = seen(session, packing), contacts_in(session)
    lost = bonds != sums(at.packing, k_e)["n_bonds"]
    return np.inf if lost else error_of(at, k_e)


def other_unit(scene: Callable[[], Packing], length: float) -> float:
    """Give the same packing with all lengths scaled, the skin too: change of forces, relative."""
    found = []
    for factor in (1.0, length):
        packing = scaled(scene(), factor)
        with loaded(packing, set_up(packing, 1.0, SKIN * factor)) as session:
            session.commands("run 0")
            found.append((seen(session, packing), contacts_in(session)))
    (a, bonds), (b, bonds_there) = found
    if bonds != bonds_there:
        return np.inf
    return float(np.abs(b.force * length - a.force).max() / np.abs(a.force).max())


def orders_of_k_e() -> float:
    """Stiffness from 1e-6 to 1e6 between types: forces over the sum of those of a particle's pairs."""
    packing, scale = crowd(n=24, kinds=(1, 2)), {(1, 1): 1e-6, (1, 2): 1.0, (2, 2): 1e6}
    text = "".join(f"\npair_coeff {i} {j} {k!r}" for (i, j), k in scale.items())
    with loaded(packing, set_up(packing) + text) as session:
        session.commands("run 0")
        at = seen(session, packing)
    bodies, species = superellipsoid_bodies(at.packing), at.packing.species
    expected, sizes = np.zeros_like(at.force), np.zeros(packing.n)
    edges = at.packing.box.edges
    for i in range(packing.n):
        for j in range(i):
            # In this box a particle touches the nearest image of another alone.
            other = bodies[j].copy()
            other[:3] += edges * np.round((bodies[i, :3] - other[:3]) / edges)
            a, b = sorted((int(species[i]), int(species[j])))
            contact = _contact.superellipsoid_contacts(bodies[i : i + 1], other[None], scale[a, b])
            if len(contact["force"]):
                force = np.asarray(contact["force"][0])
                expected[i] += force
                expected[j] -= force
                sizes[[i, j]] += np.abs(force).max()
    touched = sizes > 0
    return float((np.abs(at.force - expected).max(axis=1)[touched] / sizes[touched]).max())


SIZES = (1e-6, 1e-4, 1e-2, 1.0, 100.0)


@cache
def all_sizes(p: float) -> Packing:
    """Pairs of all sizes from 1e-6 to 100 in one box, each pair with an overlap of a tenth of the smaller."""
    rng, position, axes, at = np.random.default_rng(4), [], [], 0.0
    for k, large in enumerate(SIZES):
        for small in SIZES[: k + 1]:
            line = rng.normal(size=3)
            line /= np.linalg.norm(line)
            at += 3 * large + 1
            position += [np.array([at, 0.0, 0.0]), np.array([at, 0.0, 0.0]) + large * line]
            axes += [large * np.array([1.0, 0.8, 0.7]), small * np.array([0.8, 1.0, 0.9])]
            at += 3 * large + 1
    centred = np.array(position) - [at / 2, 0.0, 0.0]
    turn = rng.normal(size=(len(axes), 4))
    loose = particles(centred, turn, axes, p, [at + 800.0, 800.0, 800.0])
    return loose.with_(position=_touching(loose))


def _touching(packing: Packing) -> FloatArray:
    """Move the second of each pair until the smaller overlaps by about a tenth of its size."""
    x, small = packing.position.copy(), packing.diameters[1::2].min(axis=1) / 2
    i, j = superellipsoid_bodies(packing)[::2], superellipsoid_bodies(packing)[1::2]
    line = j[:, :3] - i[:, :3]
    length = np.linalg.norm(line, axis=1)
    eta = _contact.superellipsoid_scales(i, j)["eta"]
    x[1::2] = x[::2] + (line.T * (1 / eta - 0.1 * small / length)).T
    return x


def lost_digits(p: float) -> float:
    """Compare forces of all sizes with the contacts pair by pair, over what rounding and the bounds of eta allow."""
    packing = all_sizes(p)
    with loaded(packing, set_up(packing)) as session:
        session.commands("run 0")
        at = seen(session, packing)
    i, j = superellipsoid_bodies(at.packing)[::2], superellipsoid_bodies(at.packing)[1::2]
    contact = _contact.superellipsoid_contacts(i, j, 1.0)
    if len(contact["force"]) != len(i):
        return np.inf
    error = np.abs(at.force[::2] - contact["force"]).max(axis=1)
    error = np.maximum(error, np.abs(at.force[1::2] + contact["force"]).max(axis=1))
    # U = k_e (1 - eta^2)^2 / 2 has the stiffness 4 k_e / r^2 along r, and F / R across, R the smaller
    # size; a coordinate is rounded by half its spacing on either side.
    r = np.linalg.norm(j[:, :3] - i[:, :3], axis=1)
    small = at.packing.diameters[1::2].min(axis=1) / 2
    force = np.linalg.norm(contact["force"], axis=1)
    rounded = EPS * np.abs(np.concatenate([i[:, :3], j[:, :3]], axis=1)).max(axis=1)
    allowed = (4 / r**2 + force / small) * rounded + (EPS + contact["error"]) * 4 / r
    return float((error / allowed).max())


def pair_cases() -> list[Case]:
    """List what the pair style must stand."""
    found, what = [], "forces against bindings, relative"
    scenes: dict[str, Callable[[], Packing]] = {
        **SCENES,
        "p 0.55 to 10 in one box": partial(
            crowd, n=28, kinds=range(7), shapes=(np.tile([0.5, 0.6, 0.7], (7, 1)), EXPONENTS)
        ),
        "spheres": partial(crowd, 3, (2,), 16, shapes=([[0.5] * 3] * 3, [1.0] * 3)),
    }
    for name, scene in scenes.items():
        found.append(Case(PAIR, name, what, _FORCES, partial(force_error, scene)))
    for name in ("own images", "plane, own images"):
        run = partial(force_error, scenes[name], newton="off")
        found.append(Case(PAIR, f"{name}, newton off", what, _FORCES, run))
    for name in ("all shapes", "plane, all shapes", "own images"):
        for length, k_e in UNITS:
            if length != 1:
                run = partial(other_unit, scenes[name], length)
                label = f"{name}, unit of length {length:g}"
                found.append(Case(PAIR, label, "change of scaled forces", _FORCES, run))
            else:
                run = partial(force_error, scenes[name], k_e)
                found.append(Case(PAIR, f"{name}, k_e {k_e:g}", what, _FORCES, run))
    label = "k_e 1e-6, 1 and 1e6 in one box"
    found.append(Case(PAIR, label, "forces against sums by type", _FORCES, orders_of_k_e))
    for p in (0.75, 1.0, 1.5):
        label, run = f"sizes 1e-6 to 100 in one box, p {p:g}", partial(lost_digits, p)
        found.append(Case(PAIR, label, "forces pair by pair, over rounding and bounds", 8.0, run))
    for p in (0.55, 1.0, 10.0):
        for dimension in (2, 3):
            packing = coincident(p, dimension)
            run_there = partial(sentence, packing, set_up(packing) + "\nrun 0")
            label = f"{dimension}D, coincident centres, p {p:g}"
            found.append(Case(PAIR, label, "sentence", _COINCIDING, run_there))
    return found


def coincident(p: float, dimension: int) -> Packing:
    """Two at the same place."""
    position = np.ones((2, dimension))
    turn = [0.1, 0.7] if dimension == 2 else [[1.0, 0.1, 0.2, 0.3], [1.0, 0.3, 0.0, 0.1]]
    return particles(position, turn, [0.5, 0.6, 0.8], p, [9.0] * dimension)


# --- the fix -------------------------------------------------------------------------------------


@cache
def dense(dimension: int) -> Packing:
    """Sixteen particles of four shapes, with deep and shallow overlaps."""
    return crowd(dimension, n=16, phi=0.8)


def unit_of_time(k_e: float, k_d: float, length: float, dimension: int) -> float:
    """k_d V over the stiffness of a contact."""
    return k_d * length ** (dimension + 2) / k_e


def _driven(dimension: int, k_e: float, k_d: float, length: float, steps: int = 100) -> Frame:
    t0 = unit_of_time(k_e, k_d, length, dimension)
    packing = scaled(dense(dimension), length)
    text = set_up(packing, k_e, SKIN * length) + "\n" + fix(k_d, 1e-3 / t0, 0.01 * t0)
    with loaded(packing, text) as session:
        session.commands(f"run {steps}")
        return seen(session, packing)


@cache
def _reference(dimension: int) -> Frame:
    return _driven(dimension, 1.0, 1.0, 1.0)


def invariant(dimension: int, k_e: float, k_d: float, length: float) -> float:
    """Change of the final poses when units of energy, time and length change."""
    a, b = _reference(dimension), _driven(dimension, k_e, k_d, length)
    return max(apart(a, b, length), abs(b.strain - a.strain))


def two_spheres(overlap: float) -> Packing:
    """Of diameter 1, side by side."""
    return particles([[0.0] * 3, [1.0 - overlap, 0.0, 0.0]], [1.0, 0, 0, 0], 0.5, 1.0, [20.0] * 3)


# U = k_e (1 - r^2)^2 / 2 has the stiffness 4 k_e at r = 1; both move, each with the drag k_d V.
_RATE = 2 * 4 / (np.pi / 6)


def limit_error(length: float, k_e: float, k_d: float) -> float:
    """Largest stable time step that the fix gives, against 2 over the rate in closed form."""
    packing = scaled(two_spheres(1e-9), length)
    limit = 2 / _RATE * unit_of_time(k_e, k_d, length, 3)
    text = set_up(packing, k_e, SKIN * length) + "\n" + fix(k_d, 0.0, 1e-3 * limit)
    with loaded(packing, text) as session:
        session.commands("run 1")
        return abs(float(session.lmp.extract_fix("flow", 0, 1, 3)) / limit - 1)


def relaxation_error(fraction: float, steps: int) -> float:
    """Overlap left after so many steps, from that of Heun's method, over rounding and the next order."""
    overlap, dt = 1e-6, fraction * 2 / _RATE
    packing = two_spheres(overlap)
    with loaded(packing, set_up(packing) + "\n" + fix(1.0, 0.0, dt)) as session:
        session.commands(f"run {steps}")
        x = seen(session, packing).packing.position
    h = _RATE * dt
    # Past half of the limit the first stage parts the spheres, and the second has no force.
    a_step = 1 - h + h**2 / 2 if h < 1 else 1 - h / 2
    error = abs(1 - abs(float(x[1, 0] - x[0, 0])) - overlap * a_step**steps)
    # dU/dr = -4 k_e (s - 3 s^2 / 2 + ...) of s = 1 - r: the second term acts over at most h steps.
    return error / (steps * EPS + 3 * overlap**2 * min(h * steps, 2.0))


def past_the_limit(factor: float, length: float = 1.0) -> str:
    """Ask for a time step beyond the limit."""
    packing = scaled(two_spheres(1e-6), length)
    dt = factor * 2 / _RATE * unit_of_time(1.0, 1.0, length, 3)
    text = set_up(packing, 1.0, SKIN * length) + "\n" + fix(1.0, 0.0, dt)
    return sentence(packing, f"{text}\nrun 10")


def rates_changed(dimension: int, factor: float) -> float:
    """Kappa changed by this factor from a step to the next and back: box against strain, and forces."""
    packing, strain = dense(dimension), 0.0
    kappas = [1e-2, 1e-2 / factor, 1e-2, -1e-2 / factor, 1e-2]
    with loaded(packing, set_up(packing) + "\n" + fix(1.0, kappas[0], 0.01)) as session:
        session.commands("run 0")
        edges = packing.box.edges
        for kappa in kappas:
            for steps in (1, 7):
                session.commands("unfix flow\n" + fix(1.0, kappa, 0.01) + f"\nrun {steps}")
                strain += kappa * 0.01 * steps
        end = seen(session, packing)
    by_box = np.abs(end.packing.box.edges / (edges * np.exp(-strain)) - 1).max()
    return float(max(by_box, error_of(end)))


def restarted(dimension: int) -> float:
    """Restart in the middle of a run while all relax, against going on without."""
    packing, steps = dense(dimension), 100
    text = set_up(packing) + "\n" + fix(1.0, 1e-3, 0.02)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "middle.restart"
        with loaded(packing, text) as session:
            session.commands(f"run {steps}\nwrite_restart {path}\nrun {steps}")
            whole = seen(session, packing)
        with Session() as session:
            session.load_restart(path)
            session.commands(f"{text[text.index('neighbor') :]}\nrun {steps}")
            again = seen(session, packing)
    return max(apart(whole, again), abs(whole.strain - again.strain))


def extreme_run(scene: Callable[[], Packing]) -> float:
    """After two driven steps that choose their size: finite, no contact lost, forces of the bindings."""
    packing = scene()
    options = "integrator heun/adaptive tolerance 1e-3"
    with loaded(packing, set_up(packing) + "\n" + fix(1.0, 1e-4, 0.01, options)) as session:
        session.commands("run 0")
        before = measured(session, 2)
        session.commands("run 2")
        at, bonds, after = seen(session, packing), contacts_in(session), measured(session, 2)
    lost = bonds != sums(at.packing, 1.0)["n_bonds"] or not after < before
    return np.inf if lost else error_of(at)


def fix_cases() -> list[Case]:
    """List what the driven dynamics must stand."""
    found, what = [], "change of scaled poses"
    for dimension in (2, 3):
        for ratio in (1e-6, 1e6):
            for k_e, k_d in ((ratio, 1.0), (1.0, 1 / ratio)):
                label = f"{dimension}D, k_e/k_d {ratio:g} by k_{'e' if k_d == 1 else 'd'}"
                run = partial(invariant, dimension, k_e, k_d, 1.0)
                found.append(Case(FIX, label, what, 1e-10, run))
        for length in (1e-6, 1e6):
            label, run = (
                f"{dimension}D, unit of length {length:g}",
                partial(invariant, dimension, 1.0, 1.0, length),
            )
            found.append(Case(FIX, label, what, 1e-10, run))
        for factor in (1e6, 1e-1):
            label, run = (
                f"{dimension}D, rates changed by {factor:g}",
                partial(rates_changed, dimension, factor),
            )
            found.append(Case(FIX, label, "box and forces", _FORCES, run))
        label, run = f"{dimension}D, restart within a run", partial(restarted, dimension)
        found.append(Case(FIX, label, "distance from the run without", 1e-12, run))
    for length, k_e, k_d in ((1.0, 1.0, 1.0), (1e-6, 1.0, 1.0), (1e6, 1.0, 1.0), (1.0, 1e6, 1e-6)):
        label = f"stability limit, length {length:g}, k_e {k_e:g}, k_d {k_d:g}"
        run = partial(limit_error, length, k_e, k_d)
        # The stiffness at an overlap of 1e-9 is that of the first touch to 1e-8.
        found.append(Case(FIX, label, "against its closed form, relative", 1e-8, run))
    for fraction, steps in ((1e-12, 1000), (1e-6, 1000), (1e-3, 1000), (0.1, 50), (0.5, 20), (0.89, 50)):  # fmt: skip
        label, run = f"dt {fraction:g} of the limit", partial(relaxation_error, fraction, steps)
        found.append(Case(FIX, label, "distance from Heun's method, over rounding", 1.0, run))
    for factor in (1.05, 10.0, 1e6):
        run_there = partial(past_the_limit, factor)
        found.append(Case(FIX, f"dt {factor:g} of the limit", "sentence", _PAST, run_there))
    words = rf"{_PAST} [1-9]"
    run_there = partial(past_the_limit, 2.0, 1e-2)
    found.append(Case(FIX, "dt 2 of a limit of 1e-11", "sentence", words, run_there))
    for name in ("all shapes", "plane, all shapes", "own images", "overlap of a third"):
        run = partial(extreme_run, SCENES[name])
        heavy = name == "all shapes"
        found.append(Case(FIX, name, "forces after two steps", _FORCES, run, heavy))
    return found


# --- two ranks -----------------------------------------------------------------------------------

_MPIRUN = ("mpirun", "--mca", "mpi_yield_when_idle", "1", "--oversubscribe", "-np")
_MPI_AS_ROOT = ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM")
_COLUMNS = "id x y z quatw quati quatj quatk fx fy fz tqx tqy tqz"


class Scene(NamedTuple):
    """A packing, and the input after its data file."""

    packing: Packing
    text: str


def on_ranks(ranks: int, scene: Scene, steps: int) -> FloatArray:
    """Poses, forces and torques after a run in a process of its own, sorted by ID."""
    with tempfile.TemporaryDirectory() as folder:
        data, deck, dump = (Path(folder) / name for name in ("start.data", "case.in", "end.dump"))
        write_data(data, scene.packing)
        lines = f"""
            include {ROOT / "inputs" / "load_plugin.lmp"}
            units lj
            dimension {scene.packing.dimension}
            atom_style ellipsoid
            atom_modify map array
            read_data {data}
            {scene.text}
            compute seen all property/atom {_COLUMNS}
            dump ends all custom {max(steps, 1)} {dump} c_seen[*]
            dump_modify ends format float %.17g
            run {steps}"""
        deck.write_text("\n".join(line.strip() for line in lines.strip().splitlines()) + "\n")
        command = ["lmp", "-nocite", "-log", "none", "-in", str(deck)]
        done = subprocess.run(
            [*_MPIRUN, str(ranks), *command] if ranks > 1 else command,
            env=os.environ
            | dict.fromkeys(_MPI_AS_ROOT, "1")
            | {"JAMSHAPE_PLUGIN": str(plugin_path()), "OMP_NUM_THREADS": "1"},
            cwd=folder,
            text=True,
            capture_output=True,
            timeout=120,
            check=False,
        )
        if done.returncode != 0:
            raise RuntimeError((done.stdout + done.stderr)[-300:])
        rows = dump.read_text().splitlines()[-scene.packing.n :]
    table = np.array([row.split() for row in rows], float)
    return np.asarray(table[table[:, 0].argsort()])


def ranks_differ(scene: Callable[[], Scene], steps: int) -> float:
    """Change of poses over the box edge, and of forces and torques over the largest, by a second rank."""
    there = scene()
    one, two = (on_ranks(ranks, there, steps) for ranks in (1, 2))
    edges = np.append(there.packing.box.edges, 1.0)[:3]
    shift = (one[:, 1:4] - two[:, 1:4]) / edges
    change = np.abs(one - two)
    worst = [np.abs(shift - np.round(shift)).max(), change[:, 4:8].max()]
    parts = (slice(8, 11), slice(11, 14))
    worst += [change[:, own].max() / (np.abs(one[:, own]).max() or 1.0) for own in parts]
    return float(max(worst))


def _rods(packing: Callable[[], Packing], flow: str = "") -> Scene:
    return Scene(packing(), set_up_of_rods("two") + "\n" + flow)


def _supers(packing: Callable[[], Packing], flow: str = "") -> Scene:
    there = packing()
    return Scene(there, set_up(there) + "\n" + flow)


def rank_cases() -> list[Case]:
    """List what must not depend on how the box is divided."""
    flow, ratios = fix(1.0, 1e-3, 0.01), partial(all_aspect_ratios, 2)
    supers: dict[str, Callable[[], Packing]] = {
        "own images": partial(tiny_box, 3, (10.0, 0.55)),
        "p 0.55 and 10, w 0.1 and 10": SCENES["all shapes"],
    }
    scenes: dict[str, tuple[Callable[[], Scene], int]] = {
        "rods, alpha 1e-6 to 100": (partial(_rods, ratios), 0),
        "rods, own images": (partial(_rods, partial(own_images, 3)), 0),
        "jammed rods in motion": (partial(_rods, partial(jammed, 1.0), flow), 200),
        "superellipsoids in motion": (partial(_supers, partial(dense, 3), flow), 50),
        **{
            f"superellipsoids, {name}": (partial(_supers, packing), 0)
            for name, packing in supers.items()
        },
    }
    found = []
    for name, (scene, steps) in scenes.items():
        judge = partial(ranks_differ, scene, steps)
        found.append(Case(RANKS, name, "change of poses and forces", 1e-12, judge))
    return found


def cases() -> list[Case]:
    """All of them."""
    return [*pair_cases(), *fix_cases(), *rank_cases()]
