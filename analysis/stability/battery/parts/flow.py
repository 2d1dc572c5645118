"""Cases of the stability battery: driven dynamics, `fix overdamped/affine`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from battery.case import Case
from battery.parts.pair_style import difference, expected_of
from battery.scenes.elongated import jammed, jammed_off_kinks
from battery.scenes.making import EPS, Scene, scaled, wrapped
from battery.session import (
    OUTPUT,
    SKIN,
    Frame,
    Setting,
    bonds_in,
    fix,
    frame,
    loaded,
    measured,
    neighbours,
    sentence,
    set_up,
)
from battery.shapes.shape import Drive, Law, Shape, is_long
from battery.shapes.table import RODS, SHAPES
from jamshape.arrays import FloatArray
from jamshape.lammps.session import Session
from jamshape.packing import Packing

PAST = r"above the stability limit .* use a timestep below"
TOO_FAR = "one step moves atom .* expected at most half its radius: use a smaller timestep"
CROSSING = "crossing spines or coinciding centres, where no contact force exists"


def apart(a: Frame, b: Frame, unit: float = 1.0) -> float:
    """Largest distance of particles, angle between their orientations and difference of strains of two states."""
    moved = wrapped(b.packing.position / unit - a.packing.position, a.packing.box.edges)
    chords = [np.abs(b.quaternion - sign * a.quaternion).max(axis=1) for sign in (1, -1)]
    turned = 2 * np.minimum(*chords).max()
    return float(max(np.abs(moved).max(), turned, abs(b.strain - a.strain)))


def forces_of(at: Frame, shape: Shape, law: Law) -> float:
    """Difference of forces from the bindings, in the units of the shape."""
    bindings = law._replace(is_of_oracle=False)
    return difference(at, shape, expected_of(at, shape, bindings))


def by_box(at: Frame, edges: FloatArray, strain: float) -> float:
    """Distance of the box from that of a strain, relative."""
    return float(np.abs(at.packing.box.edges / (edges * np.exp(-strain)) - 1).max())


# --- units ---------------------------------------------------------------------------------------


def unit_of_time(k_e: float, k_d: float, length: float, dimension: int) -> float:
    """k_d V over the stiffness of a contact."""
    return k_d * length ** (dimension + 2) / k_e


Constants = tuple[float, float, float]
"""k_e, k_d and the unit of length."""


def _driven(drive: Drive, law: Law, constants: Constants) -> Frame:
    k_e, k_d, length = constants
    packing = scaled(drive.scene(), length)
    t0 = unit_of_time(k_e, k_d, length, packing.dimension)
    text = set_up(packing, Setting(law.sides, k_e, SKIN * length))
    text += fix(drive.kappa / t0, drive.dt * t0, k_d)
    with loaded(packing, text) as session:
        session.commands(f"run {drive.steps}")
        return frame(session, packing)


@cache
def _in_units_of_one(drive: Drive, law: Law) -> Frame:
    return _driven(drive, law, (1.0, 1.0, 1.0))


def invariant(drive: Drive, law: Law, constants: Constants) -> float:
    """Change of the final poses when units of energy, time and length change."""
    return apart(_in_units_of_one(drive, law), _driven(drive, law, constants), constants[2])


# --- time steps ----------------------------------------------------------------------------------


def _two(shape: Shape, overlap: float, dt: float, constants: Constants) -> tuple[Packing, str]:
    """Two discs or spheres, and the input of their relaxation, dt in their unit of time."""
    k_e, k_d, length = constants
    packing = scaled(shape.flow.touch.scene(overlap), length)
    t0 = unit_of_time(k_e, k_d, length, packing.dimension)
    text = set_up(packing, Setting(k_e=k_e, skin=SKIN * length)) + fix(0.0, dt * t0, k_d)
    return packing, text


def limit_error(shape: Shape, constants: Constants) -> float:
    """Largest stable time step that the fix gives, against 2 over the rate in closed form."""
    limit = 2 / shape.flow.touch.rate
    packing, text = _two(shape, 1e-9, 1e-3 * limit, constants)
    with loaded(packing, text) as session:
        session.commands("run 1")
        found = float(session.lmp.extract_fix("flow", 0, 1, 3))
    k_e, k_d, length = constants
    return abs(found / (limit * unit_of_time(k_e, k_d, length, packing.dimension)) - 1)


def relaxation_error(shape: Shape, fraction: float, steps: int) -> float:
    """Overlap left after so many steps, from that of Heun's method, over rounding and the next order."""
    touch = shape.flow.touch
    h = 2 * fraction
    packing, text = _two(shape, touch.overlap, h / touch.rate, (1.0, 1.0, 1.0))
    with loaded(packing, text) as session:
        session.commands(f"run {steps}")
        x = frame(session, packing).packing.position
    # Past half of the limit the first stage parts the spheres, and the second has no force.
    a_step = 1 - h + h**2 / 2 if h < 1 else 1 - h / 2
    overlap = touch.length - abs(float(x[1, 0] - x[0, 0]))
    error = abs(overlap - touch.overlap * a_step**steps)
    # The second order of the law acts over at most h steps.
    return error / (steps * EPS + touch.second * touch.overlap**2 * min(h * steps, 2.0))


def past_the_limit(shape: Shape, factor: float, length: float = 1.0) -> str:
    """Ask for a time step beyond the limit."""
    touch = shape.flow.touch
    packing, text = _two(shape, touch.overlap, factor * 2 / touch.rate, (1.0, 1.0, length))
    return sentence(packing, f"{text}\nrun 10")


def unchecked(shape: Shape, kappa: float, dt: float, options: str = "") -> str:
    """Take steps without end, or shrink the box to nothing from one step to the next."""
    packing = shape.flow.touch.scene(0.1)
    return sentence(packing, set_up(packing) + fix(kappa, dt, options=options) + "run 10")


def half_steps(law: Law) -> float:
    """Ratio of the errors of two time steps over that of a method of second order, less 1."""
    start, ends = jammed(0.0), []
    for steps in (100, 200, 800):
        text = set_up(start, Setting(law.sides)) + fix(1e-3, 4.0 / steps)
        with loaded(start, text) as session:
            session.commands(f"run {steps}")
            ends.append(frame(session, start).packing.position)
    coarse, fine = (np.abs(end - ends[2]).max() for end in ends[:2])
    return abs(float(coarse / fine) * 15 / 63 - 1)  # the reference has an error too


# --- rates ---------------------------------------------------------------------------------------


def lone_particle(shape: Shape, kappa: float, dt: float, steps: int) -> float:
    """Box and positions of particles that touch nothing, against the exponential, relative."""
    packing = shape.flow.lone()
    with loaded(packing, set_up(packing) + fix(kappa, dt)) as session:
        session.commands("run 0")
        before = frame(session, packing)
        session.commands(f"run {steps}")
        end = frame(session, packing)
    strain = kappa * dt * steps
    moved = np.abs(end.packing.position - np.exp(-strain) * packing.position).max() / 4.0
    turned = 2 * np.abs(end.quaternion - before.quaternion).max()
    by_strain = abs(end.strain - strain) / abs(strain)
    return float(max(turned, by_box(end, packing.box.edges, strain), moved, by_strain))


def rates_changed(drive: Drive, shape: Shape, factor: float) -> float:
    """Kappa changed by this factor from a step to the next and back: box against strain, and forces."""
    packing, law, strain = drive.scene(), shape.laws[-1], 0.0
    kappa, dt = drive.kappa, drive.dt
    with loaded(packing, set_up(packing, Setting(law.sides)) + fix(kappa, dt)) as session:
        session.commands("run 0")
        for now in (kappa, kappa / factor, kappa, -kappa / factor, kappa):
            for steps in (1, 7):
                session.commands("unfix flow" + fix(now, dt) + f"run {steps}")
                strain += now * dt * steps
        end = frame(session, packing)
    return max(by_box(end, packing.box.edges, strain), forces_of(end, shape, law))


def steps_changed(drive: Drive, shape: Shape, factor: float) -> float:
    """Change the time step by this factor between steps: box against the strain, and forces."""
    packing, law, strain = drive.scene(), shape.laws[-1], 0.0
    with loaded(
        packing, set_up(packing, Setting(law.sides)) + fix(drive.kappa, drive.dt)
    ) as session:
        session.commands("run 0")
        for dt in (drive.dt, drive.dt / factor) * 2:
            session.commands(f"timestep {dt!r}\nrun 3")
            strain += drive.kappa * dt * 3
        end = frame(session, packing)
    return max(by_box(end, packing.box.edges, strain), forces_of(end, shape, law))


def power_balance(kappa: float, law: Law) -> float:
    """dU/dt = 2 kappa p L^2 - dissipation, over one short step, relative to the larger term."""
    packing, dt, found = jammed_off_kinks(1.0), 1e-4, []
    with loaded(packing, set_up(packing, Setting(law.sides)) + fix(kappa, dt)) as session:
        session.commands("run 3")
        for _ in range(3):
            session.commands("run 1")
            volume = float(np.prod(frame(session, packing).packing.box.edges))
            u, p = measured(session, "energy"), measured(session, "pressure")
            lost = float(session.lmp.extract_fix("flow", 0, 1, 4))
            found.append((u * volume, 2 * kappa * p * volume - lost, lost))
    rate = (found[2][0] - found[0][0]) / (2 * dt)
    return float(abs(rate - found[1][1]) / found[1][2])


# --- restarts ------------------------------------------------------------------------------------


def restarted(drive: Drive, law: Law) -> float:
    """Restart within a run, against going on without; twice the steps in all."""
    return _restarted_at(drive, law, drive.steps, drive.steps)


def _restarted_at(drive: Drive, law: Law, middle: int, rest: int) -> float:
    packing = drive.scene()
    text = set_up(packing, Setting(law.sides)) + fix(drive.kappa, drive.dt)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "middle.restart"
        with loaded(packing, text) as session:
            session.commands(f"run {middle}\nwrite_restart {path}")
        with loaded(packing, text) as session:
            session.commands(f"run {middle + rest}")
            whole = frame(session, packing)
        with Session() as session:
            session.load_restart(path, packing)
            flow = fix(drive.kappa, drive.dt)
            session.commands(f"{neighbours()}\n{flow}{OUTPUT}\nrun {rest}")
            again = frame(session, packing)
    return apart(whole, again)


EVENTFUL = Drive(partial(jammed, 4.0, 24, 0.8), 3e-5, 0.2, 8000)


def restarted_in_an_event(law: Law) -> float:
    """Restart where the energy of a driven packing falls fastest, against going on without."""
    packing, energies = EVENTFUL.scene(), []
    text = set_up(packing, Setting(law.sides)) + fix(EVENTFUL.kappa, EVENTFUL.dt)
    with loaded(packing, text) as session:
        session.commands(f"run {EVENTFUL.steps}")
        for _ in range(40):
            session.commands("run 100 pre no post no")
            energies.append(measured(session, "energy"))
    falls = np.diff(energies)
    if falls.min() >= 0:
        return np.inf
    event = EVENTFUL.steps + 100 * (1 + int(falls.argmin())) + 50  # in the middle of the fall
    return _restarted_at(EVENTFUL, law, event, 1000)


# --- extremes ------------------------------------------------------------------------------------


def extreme_run(scene: Scene, shape: Shape, law: Law) -> float:
    """After some driven steps: finite, no contact lost, forces of the bindings."""
    packing, own = scene(), shape.flow
    with loaded(packing, set_up(packing, Setting(law.sides)) + own.extreme_drive) as session:
        session.commands("run 0")
        before = measured(session, "energy")
        session.commands(f"run {own.extreme_steps}")
        at, bonds = frame(session, packing), bonds_in(session)
        rose = own.must_relax and not measured(session, "energy") < before
    expected = expected_of(at, shape, law._replace(is_of_oracle=False))
    lost = bonds != expected.n_bonds
    return np.inf if lost or rose else difference(at, shape, expected)


def compressed_deep() -> float:
    """Driven from jamming until the deepest overlap is a third: forces in overlaps."""
    packing, law = jammed(0.0), RODS.laws[-1]
    with loaded(packing, set_up(packing, Setting(law.sides)) + fix(5e-3, 0.02)) as session:
        session.commands("run 0")
        for _ in range(60):
            session.commands("run 100")
            if measured(session, "deepest") > 1 / 3:
                return forces_of(frame(session, packing), RODS, law)
    return np.inf


def compressed_until_crossing() -> str:
    """Driven until spines cross, or a step is too far."""
    packing = jammed(1.0)
    flow = fix(5e-2, 0.02, options="check 0")
    return sentence(packing, set_up(packing) + flow + "run 100000")


# --- cases ---------------------------------------------------------------------------------------


def part_of(shape: Shape) -> str:
    """Name of the part, under which its cases stand."""
    return f"fix overdamped/affine, {shape.name}"


def of_units(shape: Shape, law: Law) -> Iterator[Case]:
    """List runs in other units."""
    part, what = part_of(shape), "change of scaled poses"
    for name, drive in shape.flow.invariant.items():
        for ratio in (1e-6, 1e-3, 1e3, 1e6):
            for k_e, k_d in ((ratio, 1.0), (1.0, 1 / ratio)):
                label = f"{name}k_e/k_d {ratio:g} by k_{'e' if k_d == 1 else 'd'}{law.words}"
                run = partial(invariant, drive, law, (k_e, k_d, 1.0))
                yield Case(part, label, what, 1e-10, run)
        for length in (1e-6, 1e6):
            label = f"{name}unit of length {length:g}{law.words}"
            run = partial(invariant, drive, law, (1.0, 1.0, length))
            yield Case(part, label, what, 1e-10, run)


def of_steps(shape: Shape) -> Iterator[Case]:
    """List time steps of all sizes."""
    part = part_of(shape)
    for constants in ((1.0, 1.0, 1.0), (1.0, 1.0, 1e-6), (1.0, 1.0, 1e6), (1e6, 1e-6, 1.0)):
        k_e, k_d, length = constants
        label = f"stability limit, length {length:g}, k_e {k_e:g}, k_d {k_d:g}"
        what, limit = "against its closed form, relative", partial(limit_error, shape, constants)
        # The stiffness at an overlap of 1e-9 is that of the first touch to 1e-8.
        yield Case(part, label, what, 1e-8, limit)
    for fraction, steps in (
        (1e-12, 1000), (1e-6, 1000), (1e-3, 1000), (0.1, 50), (0.5, 20), (0.89, 50),
    ):  # fmt: skip
        label, run = (
            f"dt {fraction:g} of the limit",
            partial(relaxation_error, shape, fraction, steps),
        )
        yield Case(part, label, "distance from Heun's closed form, over rounding", 1.0, run)
    stop: Any
    for factor in (1.05, 10.0, 1e6):
        label, stop = f"dt {factor:g} of the limit", partial(past_the_limit, shape, factor)
        heavy = factor > 2 and shape.flow.few_stops
        yield Case(part, label, "sentence", PAST, stop, heavy)
    stop = partial(past_the_limit, shape, 2.0, 1e-2)
    heavy = shape is RODS or shape.flow.few_stops
    yield Case(part, "dt 2 of a tiny limit", "sentence", rf"{PAST} [1-9]", stop, heavy)
    for dt in (10.0, 1e300):
        stop = partial(unchecked, shape, 0.0, dt, "check 0")
        # What the fix says is no matter of shape, and each process takes half a second.
        yield Case(part, f"dt {dt:g}, no check", "sentence", TOO_FAR, stop, shape is not RODS)


def of_rates(shape: Shape) -> Iterator[Case]:
    """List rates of all sizes, and changing ones."""
    part, what = part_of(shape), "box, lone particles, relative"
    for kappa in (1e-3, 1e-5, 1e-7, 1e-10, -1e-10):
        run = partial(lone_particle, shape, kappa, 0.1, 1000)
        yield Case(part, f"kappa {kappa:g}", what, 1e-14, run)
    run = partial(lone_particle, shape, 1e-3, 1e-9, 1000)
    yield Case(part, "kappa 1e-3, dt 1e-9", what, 1e-14, run)
    for kappa in (10.0, 1e3, 1e10):
        # The box would shrink by half, or to nothing, from one step to the next.
        words = r"smaller timestep|use a timestep|smaller rate|compress"
        stop: Any = partial(unchecked, shape, kappa, 0.1)
        yield Case(part, f"kappa {kappa:g}", "sentence", words, stop, shape is not RODS)
    for name, drive in shape.flow.changed.items():
        for factor in (1e6, 1e-1):
            label = f"rates changed by {factor:g}, {name}"
            run = partial(rates_changed, drive, shape, factor)
            yield Case(part, label, "box and forces", 1e-12, run)
        label, run = f"dt changed by 1e6, {name}", partial(steps_changed, drive, shape, 1e6)
        yield Case(part, label, "box and forces", 1e-12, run)


def of_runs(shape: Shape, law: Law) -> Iterator[Case]:
    """List restarts, and runs of extreme packings."""
    part = part_of(shape)
    for name, drive in shape.flow.restarted.items():
        label, run = f"restart within a run, {name}{law.words}", partial(restarted, drive, law)
        yield Case(part, label, "distance from the run without", 1e-12, run)
    for name, scene in shape.flow.extreme.items():
        limit = shape.flow.limit * (5 if is_long(name) else 1)
        label, run = f"{name}{law.words}", partial(extreme_run, scene, shape, law)
        heavy = name in shape.flow.heavy
        yield Case(part, label, f"forces after a run, {shape.units.words}", limit, run, heavy)


def of_rods() -> Iterator[Case]:
    """List what is tried with rods alone: events, energy balance, order of the method, ends of compressions."""
    part = part_of(RODS)
    for law in RODS.laws:
        for kappa in (1e-3, 1e-10):
            label, run = (
                f"power balance, kappa {kappa:g}{law.words}",
                partial(power_balance, kappa, law),
            )
            yield Case(part, label, "dU/dt against work and drag", 1e-5, run)
        label, run = (
            f"restart within a plastic event{law.words}",
            partial(restarted_in_an_event, law),
        )
        yield Case(part, label, "distance from the run without", 1e-12, run)
    run, what = (
        partial(half_steps, RODS.laws[0]),
        "ratio of errors over that of second order, less 1",
    )
    yield Case(part, "half the step", what, 0.1, run)
    label = "compressed to overlaps of a third"
    yield Case(part, label, "forces, in overlaps", 1e-14, compressed_deep)
    label, words = "compressed until spines cross", f"{CROSSING}|{TOO_FAR}"
    yield Case(part, label, "sentence", words, compressed_until_crossing)


def cases() -> list[Case]:
    """All of them."""
    found: list[Case] = []
    for shape in SHAPES:
        found += [*of_steps(shape), *of_rates(shape)]
        for law in shape.laws:
            found += [*of_units(shape, law), *of_runs(shape, law)]
    return [*found, *of_rods()]
