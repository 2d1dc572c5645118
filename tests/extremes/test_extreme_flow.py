"""Driven dynamics, `fix overdamped/affine`."""

from functools import cache, partial

import numpy as np
from extreme import case, extreme
from extreme_in_lammps import (
    OUTPUT,
    SKIN,
    after,
    fix,
    frame,
    from_bindings,
    loaded,
    measured,
)
from extreme_rods import jammed, jammed_off_kinks
from extreme_shapes import RODS, SHAPES, Drive, is_long
from lammps_runs import after_restart, fix_vector, state_of
from lammps_runs import restarted as from_restart
from lammps_scenes import angle_between, nearest_image
from packings_in_a_box import EPS, scaled

PAST = r"above the stability limit .* use a timestep below"
TOO_FAR = "one step moves atom .* expected at most half its radius: use a smaller timestep"
CROSSING = "crossing spines or coinciding centres, where no contact force exists"

LAWS = [(shape, law) for shape in SHAPES for law in shape.laws]


def label_of(shape, name, law=None):
    return f"fix overdamped/affine, {shape.name}: {name}{law.words if law else ''}"


def apart(a, b, unit=1.0):
    """Largest distance of particles, angle between their orientations and difference of strains of two states."""
    moved = nearest_image(b.packing.position / unit - a.packing.position, a.packing.box)
    turned = angle_between(a.quaternion, b.quaternion).max()
    return max(np.abs(moved).max(), turned, abs(b.strain - a.strain))


def box_error(at, packing, strain):
    """Distance of the box from that of a strain, relative."""
    return np.abs(at.packing.box.edges / (packing.box.edges * np.exp(-strain)) - 1).max()


# --- units ---------------------------------------------------------------------------------------

ONE = (1.0, 1.0, 1.0)
"""k_e, k_d and the unit of length."""


def unit_of_time(k_e, k_d, length, dimension):
    """k_d V over the stiffness of a contact."""
    return k_d * length ** (dimension + 2) / k_e


@cache
def driven(drive, law, constants):
    k_e, k_d, length = constants
    packing = scaled(drive.scene(), length)
    t0 = unit_of_time(*constants, packing.dimension)
    flow = fix(drive.kappa / t0, drive.dt * t0, k_d)
    options = {"sides": law.sides, "k_e": k_e, "skin": SKIN * length}
    return after(packing, f"run {drive.steps}", flow, **options)


def other_units():
    for ratio in (1e-6, 1e-3, 1e3, 1e6):
        yield f"k_e/k_d {ratio:g} by k_e", (ratio, 1.0, 1.0)
        yield f"k_e/k_d {ratio:g} by k_d", (1.0, 1 / ratio, 1.0)
    for length in (1e-6, 1e6):
        yield f"unit of length {length:g}", (1.0, 1.0, length)


@extreme("change of scaled poses", [
    case(label_of(shape, f"{name}{words}", law), drive, law, constants)
    for shape, law in LAWS for name, drive in shape.invariant.items()
    for words, constants in other_units()
], 1e-10)  # fmt: skip
def test_units(drive, law, constants):
    return apart(driven(drive, law, ONE), driven(drive, law, constants), constants[2])


# --- time steps ----------------------------------------------------------------------------------


def two(shape, overlap, dt, constants=ONE):
    """Relaxation of two discs or spheres, dt in their unit of time."""
    k_e, k_d, length = constants
    packing = scaled(shape.touch.scene(overlap), length)
    t0 = unit_of_time(*constants, packing.dimension)
    return loaded(packing, fix(0.0, dt * t0, k_d), k_e=k_e, skin=SKIN * length)


@extreme("against its closed form, relative", [
    case(label_of(shape, f"stability limit, length {length:g}, k_e {k_e:g}, k_d {k_d:g}"), shape, (k_e, k_d, length))
    for shape in SHAPES
    for k_e, k_d, length in (ONE, (1.0, 1.0, 1e-6), (1.0, 1.0, 1e6), (1e6, 1e-6, 1.0))
], 1e-8)  # fmt: skip
def test_stability_limit(shape, constants):
    """2 over the rate; the stiffness at an overlap of 1e-9 is that of the first touch to 1e-8."""
    limit = 2 / shape.touch.rate
    with two(shape, 1e-9, 1e-3 * limit, constants) as session:
        session.commands("run 1")
        found = fix_vector(session, "flow", 4)
        dimension = state_of(session).packing.dimension
    return abs(found / (limit * unit_of_time(*constants, dimension)) - 1)


@extreme("distance from Heun's closed form, over rounding", [
    case(label_of(shape, f"dt {fraction:g} of the limit"), shape, fraction, steps)
    for shape in SHAPES
    for fraction, steps in ((1e-12, 1000), (1e-6, 1000), (1e-3, 1000), (0.1, 50), (0.5, 20), (0.89, 50))
], 1.0)  # fmt: skip
def test_relaxation(shape, fraction, steps):
    touch = shape.touch
    h = 2 * fraction
    with two(shape, touch.overlap, h / touch.rate) as session:
        session.commands(f"run {steps}")
        x = state_of(session).packing.position
    # Past half of the limit the first stage parts the spheres, and the second has no force.
    a_step = 1 - h + h**2 / 2 if h < 1 else 1 - h / 2
    overlap = touch.length - abs(float(x[1, 0] - x[0, 0]))
    error = abs(overlap - touch.overlap * a_step**steps)
    # The second order of the law acts over at most h steps.
    return error / (steps * EPS + touch.second * touch.overlap**2 * min(h * steps, 2.0))


@extreme("", [
    case(label_of(shape, name), shape, factor, (1.0, 1.0, length), expected=sentence, heavy=heavy)
    for shape in SHAPES
    for name, factor, length, sentence, heavy in (
        ("dt 1.05 of the limit", 1.05, 1.0, PAST, False),
        ("dt 10 of the limit", 10.0, 1.0, PAST, shape.few_stops),
        ("dt 1e+06 of the limit", 1e6, 1.0, PAST, shape.few_stops),
        ("dt 2 of a tiny limit", 2.0, 1e-2, rf"{PAST} [1-9]", shape is RODS or shape.few_stops),
    )
])  # fmt: skip
def test_past_the_limit(shape, factor, constants):
    touch = shape.touch
    with two(shape, touch.overlap, factor * 2 / touch.rate, constants) as session:
        session.commands("run 10")


def unchecked():
    """Steps without end, and boxes that would shrink to nothing from one step to the next."""
    for shape in SHAPES:
        # What the fix says does not depend on the shape.
        heavy = shape is not RODS
        for dt in (10.0, 1e300):
            label = label_of(shape, f"dt {dt:g}, no check")
            yield case(label, shape, 0.0, dt, "check 0", expected=TOO_FAR, heavy=heavy)
        for kappa in (10.0, 1e3, 1e10):
            words = r"smaller timestep|use a timestep|smaller rate|compress"
            label = label_of(shape, f"kappa {kappa:g}")
            yield case(label, shape, kappa, 0.1, expected=words, heavy=heavy)


@extreme("", unchecked())
def test_too_large_steps(shape, kappa, dt, options=""):
    after(shape.touch.scene(0.1), "run 10", fix(kappa, dt, options=options))


@extreme(
    "ratio of errors over that of second order, less 1",
    [case(label_of(RODS, "half the step"))],
    0.1,
)
def test_order_of_the_method():
    start = jammed(0.0)
    ends = [
        after(start, f"run {steps}", fix(1e-3, 4.0 / steps)).packing.position
        for steps in (100, 200, 800)
    ]
    coarse, fine = (np.abs(end - ends[2]).max() for end in ends[:2])
    return abs(coarse / fine * 15 / 63 - 1)  # the reference has an error too


# --- rates ---------------------------------------------------------------------------------------


@extreme("box, lone particles, relative", [
    case(label_of(shape, name), shape, kappa, dt) for shape in SHAPES
    for name, kappa, dt in (
        *((f"kappa {kappa:g}", kappa, 0.1) for kappa in (1e-3, 1e-5, 1e-7, 1e-10, -1e-10)),
        ("kappa 1e-3, dt 1e-9", 1e-3, 1e-9),
    )
], 1e-14)  # fmt: skip
def test_lone_particles(shape, kappa, dt, steps=1000):
    """Against the exponential."""
    packing, strain = shape.lone(), kappa * dt * steps
    with loaded(packing, fix(kappa, dt)) as session:
        session.commands("run 0")
        before = frame(session, packing)
        session.commands(f"run {steps}")
        end = frame(session, packing)
    moved = np.abs(end.packing.position - np.exp(-strain) * packing.position).max() / 4.0
    turned = 2 * np.abs(end.quaternion - before.quaternion).max()
    return max(turned, box_error(end, packing, strain), moved, abs(end.strain / strain - 1))


def changed():
    for shape in SHAPES:
        for name, drive in shape.changed.items():
            for factor in (1e6, 1e-1):
                kappas = [drive.kappa, drive.kappa / factor]
                legs = [(kappa, drive.dt, steps) for kappa in (*kappas, kappas[0], -kappas[1], kappas[0])
                        for steps in (1, 7)]  # fmt: skip
                label = label_of(shape, f"rates changed by {factor:g}, {name}")
                yield case(label, shape, drive, legs, fix)
            legs = [(drive.kappa, dt, 3) for dt in (drive.dt, drive.dt / 1e6) * 2]
            label = label_of(shape, f"dt changed by 1e6, {name}")
            yield case(label, shape, drive, legs, None)


@extreme("box and forces", changed(), 1e-12)
def test_changes_from_a_step_to_the_next(shape, drive, legs, renewed):
    """Rates, for which the fix is renewed, or time steps."""
    packing, law = drive.scene(), shape.laws[-1]
    with loaded(packing, fix(drive.kappa, drive.dt), sides=law.sides) as session:
        session.commands("run 0")
        for kappa, dt, steps in legs:
            change = f"unfix flow{renewed(kappa, dt)}" if renewed else f"timestep {dt!r}\n"
            session.commands(f"{change}run {steps}")
        end = frame(session, packing)
    strain = sum(kappa * dt * steps for kappa, dt, steps in legs)
    return max(box_error(end, packing, strain), from_bindings(end, shape, law))


@extreme("dU/dt against work and drag", [
    case(label_of(RODS, f"power balance, kappa {kappa:g}", law), kappa, law)
    for law in RODS.laws for kappa in (1e-3, 1e-10)
], 1e-5)  # fmt: skip
def test_power_balance(kappa, law):
    """dU/dt = 2 kappa p L^2 - dissipation, over one short step, relative to the larger term."""
    packing, dt, found = jammed_off_kinks(1.0), 1e-4, []
    with loaded(packing, fix(kappa, dt), sides=law.sides) as session:
        session.commands("run 3")
        for _ in range(3):
            session.commands("run 1")
            volume = float(np.prod(state_of(session).packing.box.edges))
            u, p = measured(session, "energy"), measured(session, "pressure")
            lost = fix_vector(session, "flow", 5)
            found.append((u * volume, 2 * kappa * p * volume - lost, lost))
    rate = (found[2][0] - found[0][0]) / (2 * dt)
    return abs(rate - found[1][1]) / found[1][2]


# --- restarts ------------------------------------------------------------------------------------


def restarted(drive, law, tmp_path, middle, rest):
    """Restart within a run, against going on without."""
    packing, flow = drive.scene(), fix(drive.kappa, drive.dt)
    with loaded(packing, flow, sides=law.sides) as session:
        session.commands(f"run {middle}\nwrite_restart {tmp_path}/middle.restart")
    whole = after(packing, f"run {middle + rest}", flow, sides=law.sides)
    text = f"{after_restart()}\n{OUTPUT}\n{flow}run {rest}"
    with from_restart(tmp_path / "middle.restart", text) as session:
        return apart(whole, frame(session, packing))


@extreme("distance from the run without", [
    case(label_of(shape, f"restart within a run, {name}", law), drive, law)
    for shape, law in LAWS for name, drive in shape.restarted.items()
], 1e-12)  # fmt: skip
def test_restart(drive, law, tmp_path):
    return restarted(drive, law, tmp_path, drive.steps, drive.steps)


EVENTFUL = Drive(partial(jammed, 4.0, 24, 0.8), 3e-5, 0.2, 8000)


@extreme("distance from the run without", [
    case(label_of(RODS, "restart within a plastic event", law), law) for law in RODS.laws
], 1e-12)  # fmt: skip
def test_restart_in_an_event(law, tmp_path):
    """Where the energy of a driven packing falls fastest."""
    packing, energies = EVENTFUL.scene(), []
    with loaded(packing, fix(EVENTFUL.kappa, EVENTFUL.dt), sides=law.sides) as session:
        session.commands(f"run {EVENTFUL.steps}")
        for _ in range(40):
            session.commands("run 100 pre no post no")
            energies.append(measured(session, "energy"))
    falls = np.diff(energies)
    if falls.min() >= 0:
        return np.inf
    middle = EVENTFUL.steps + 100 * (1 + int(falls.argmin())) + 50
    return restarted(EVENTFUL, law, tmp_path, middle, 1000)


# --- extremes ------------------------------------------------------------------------------------


@extreme("forces after a run", [
    case(label_of(shape, name, law), scene, shape, law, expected=shape.drive_limit * (5 if is_long(name) else 1),
         measure=f"forces after a run, {shape.units.words}", heavy=name in shape.drive_heavy)
    for shape, law in LAWS for name, scene in shape.driven.items()
])  # fmt: skip
def test_runs(scene, shape, law):
    """Finite, no contact lost, forces of the bindings."""
    packing = scene()
    with loaded(packing, shape.drive, sides=law.sides) as session:
        session.commands("run 0")
        before = measured(session, "energy")
        session.commands(f"run {shape.drive_steps}")
        at = frame(session, packing)
        rose = shape.must_relax and not measured(session, "energy") < before
    return np.inf if rose else from_bindings(at, shape, law)


@extreme("forces, in overlaps", [case(label_of(RODS, "compressed to overlaps of a third"))], 1e-14)
def test_compressed_deep():
    packing, law = jammed(0.0), RODS.laws[-1]
    with loaded(packing, fix(5e-3, 0.02), sides=law.sides) as session:
        session.commands("run 0")
        for _ in range(60):
            session.commands("run 100")
            if measured(session, "deepest") > 1 / 3:
                return from_bindings(frame(session, packing), RODS, law)
    return np.inf


@extreme("", [case(label_of(RODS, "compressed until spines cross"))], f"{CROSSING}|{TOO_FAR}")
def test_compressed_until_crossing():
    """Driven until spines cross, or a step is too far."""
    after(jammed(1.0), "run 100000", fix(5e-2, 0.02, options="check 0"))
