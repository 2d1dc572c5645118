"""Compressions without LAMMPS: implicit, quasistatic, and Monte Carlo of hard particles."""

import itertools
from dataclasses import replace
from functools import cache, partial

import numpy as np
from extreme import case, extreme
from extreme_rods import crossed, deep, jammed, rods
from extreme_shapes import SHAPES
from extreme_superellipsoids import hard, loose
from packings_in_a_box import contacts_of, every_image, in_doubles, scaled
from spherocylinder_pairs import TOUCHING
from test_extreme_landscape import CROSS

from jamshape.flow.implicit import METHODS, Flow, Protocol, compress
from jamshape.landscape import Landscape, State
from jamshape.minima import minimise
from jamshape.protocols.quasistatic import Quasistatic, QuasistaticRun
from jamshape.protocols.quasistatic import compress as compress_quasistatically
from jamshape.protocols.thermal import Thermal, equilibrate

IMPLICIT, QUASISTATIC, THERMAL = (
    "implicit compression",
    "quasistatic compression",
    "hard Monte Carlo",
)

# Powers of two near 1e-6 and 1e6: all of a computation without a hidden unit is then the same to the bit.
UNITS = ((2.0**-20, 1.0), (2.0**20, 1.0), (1.0, 2.0**-20), (1.0, 2.0**20))

TOLERANCE = 1e-3


# --- implicit: one contact -----------------------------------------------------------------------


def ended(packing, protocol, k_e=1.0):
    """State and steps at the end of a compression."""
    landscape, flow = Landscape(packing, k_e), Flow(State.of(packing))
    return flow, list(compress(landscape, flow, protocol))


def two_discs(overlap):
    """Their overlap x obeys dx/dt = kappa (1 - x) - 2 x / (k_d area), in units of k_e and d."""
    return rods([[-1.0, 0.0], [-overlap, 0.0]], 0.0, 0.0, 0.5, [10.0, 10.0])


RATE = 2 / (np.pi / 4)


def relaxed(overlap, kappa, t):
    steady = kappa / (RATE + kappa)
    return steady + (overlap - steady) * float(np.exp(-(RATE + kappa) * t))


def error_of(flow, exact, steps):
    """Relative error of the overlap over the local errors of all steps."""
    x = flow.state.position[:, 0]
    return abs(float(1 - abs(x[1] - x[0])) / exact - 1) / (len(steps) * TOLERANCE)


LOCAL = "error of the overlap, over local errors of all steps"


@extreme(LOCAL, [
    case(f"{IMPLICIT}: kappa {kappa:g}, {method}, from {start:g} of the steady overlap", kappa, method, start)
    for kappa in (1e-14, 1e-10, 1e-6, 1e-2, 1.0, 1e2) for method in METHODS
    for start in ((1.0, 10.0) if kappa < 1e-1 else (0.02,))
], 1.0)  # fmt: skip
def test_driven_contact(kappa, method, start):
    overlap = start * kappa / (RATE + kappa)
    packing = two_discs(overlap)
    strain = min(max(10 * kappa / RATE, 1e-8), 0.05)
    phi_end = packing.phi * np.exp(2 * strain)
    flow, steps = ended(packing, Protocol(kappa, phi_end, tolerance=TOLERANCE, method=method))
    return error_of(flow, relaxed(overlap, kappa, flow.time), steps)


@extreme(LOCAL, [
    case(f"{IMPLICIT}: rates changed by {factor:g}", factor) for factor in (1e3, 1e6, 1e12)
], 1.0)  # fmt: skip
def test_rates_changed(factor):
    """Kappa changed by this factor and back while a contact follows."""
    exact = 1e-2 / (RATE + 1e-2)
    slow, packing = 1e-2 / factor, two_discs(exact)
    phi = packing.phi * np.exp(2 * np.array([0.0, 1e-2, 1e-2 + 20 * slow, 3e-2]))
    rates = ((0.0, 1e-2), (float(phi[1]), slow), (float(phi[2]), 1e-2))
    flow, steps = ended(packing, Protocol(rates, float(phi[3]), tolerance=TOLERANCE))
    x = State.of(packing).position[:, 0]
    exact, strain = float(1 - abs(x[1] - x[0])), 0.5 * np.log(phi / packing.phi)
    for (_, kappa), part in zip(rates, np.diff(strain), strict=True):
        exact = relaxed(exact, kappa, part / kappa)
    return error_of(flow, exact, steps)


# --- implicit: packings --------------------------------------------------------------------------


@cache
def begun():
    """Twelve rods just above jamming, minimised."""
    packing = jammed(1.0, 12, 0.86)
    return in_doubles(minimise(Landscape(packing), State.of(packing)).state.packing(packing))


@cache
def pressures(length, k_e, k_d):
    t0, packing = k_d * length**4 / k_e, scaled(begun(), length)
    protocol = Protocol(2.0**-20 / t0, begun().phi * 1.01, k_d=k_d)
    steps = ended(packing, protocol, k_e)[1]
    return np.array([step.pressure for step in steps]) * length**2 / k_e


@extreme("change of scaled pressures", [
    case(f"{IMPLICIT}: length {length:.3g}, k_e {k_e:.3g}, k_d {k_d:.3g}", length, k_e, k_d)
    for length, k_e, k_d in (*((*unit, 1.0) for unit in UNITS), (1.0, 1.0, 2.0**-20), (1.0, 1.0, 2.0**20))
], 1e-12)  # fmt: skip
def test_implicit_units(length, k_e, k_d):
    p, there = pressures(1.0, 1.0, 1.0), pressures(length, k_e, k_d)
    if len(p) != len(there) or ((p > 0) != (there > 0)).any():
        return np.inf
    return np.abs(there[p > 0] / p[p > 0] - 1).max()


@extreme("energy at two tolerances, over local errors", [
    case(f"{IMPLICIT}: {name}", scene)
    for shape in SHAPES for name, scene in shape.implicit.items()
], 1.0)  # fmt: skip
def test_two_tolerances(scene, kappa=1e-2, strain=1e-3):
    packing = scene()
    protocol = Protocol(kappa, packing.phi * np.exp(2 * strain), tolerance=TOLERANCE)
    coarse, fine = (
        ended(packing, replace(protocol, tolerance=x))[1] for x in (TOLERANCE, TOLERANCE / 30)
    )
    return abs(coarse[-1].u / fine[-1].u - 1) / (len(coarse) * TOLERANCE)


@extreme("energy over that of affine motion", [
    case(f"{IMPLICIT}: overlaps of a third and beyond, kappa {kappa:g}", kappa) for kappa in (1e-10, 1e-2)
], 1.0)  # fmt: skip
def test_beyond_overlaps_of_a_third(kappa):
    """Another tenth of phi: what relaxes has less energy than what moves with the box."""
    packing = deep(2, 0.0)
    flow, _ = ended(packing, Protocol(kappa, 1.1 * packing.phi))
    start = State.of(packing)
    affine = start.strained(float(flow.state.edges[0] / start.edges[0]) - 1)
    energy, of_affine = (Landscape(packing).evaluate(x).energy for x in (flow.state, affine))
    return energy / of_affine


EVENTFUL = Protocol(1e-8, 0.86, tolerance=1e-2)


def plastic():
    """A packing that rearranges while it is compressed."""
    return jammed(4.0, 16, 0.8)


@cache
def energies(drop=EVENTFUL.largest_drop):
    return np.array([s.u for s in ended(plastic(), replace(EVENTFUL, largest_drop=drop))[1]])


@extreme(
    "distance from going on", [case(f"{IMPLICIT}: stopped within a plastic event", heavy=True)], 0.0
)
def test_stopped_in_an_event():
    """Stopped where the energy falls most and continued from public fields."""
    event = 1 + int((energies()[1:] / energies()[:-1]).argmin())
    packing, fallen = plastic(), []
    flow = Flow(State.of(packing))
    for step in compress(Landscape(packing), flow, EVENTFUL):
        fallen.append(step.u)
        if step.step == event:
            flow.forget()
            fresh = Flow(**{k: v for k, v in vars(flow).items() if not k.startswith("_")})
    rest = list(compress(Landscape(packing), fresh, EVENTFUL))
    falls = min(b / a for a, b in itertools.pairwise(fallen))
    if falls > 0.9 or rest[0].step != event + 1:
        return np.inf
    return np.abs(fresh.state.position - flow.state.position).max()


@extreme("energy lost in a step over it", [
    case(f"{IMPLICIT}: largest_drop {drop:g}", drop, heavy=True) for drop in (0.3, 0.03)
], 1.01)  # fmt: skip
def test_largest_drop(drop):
    u = energies(drop)
    # Not of energies to which drag pushes a contact at this rate.
    above = u[:-1] > 1e-12
    return (1 - u[1:] / u[:-1])[above].max() / drop


# --- implicit: what it refuses -------------------------------------------------------------------

# Each refused with its name.
WRONG = (
    {"kappa": 0.0}, {"kappa": -1e-6}, {"kappa": np.nan}, {"phi_end": -1.0}, {"phi_end": np.nan},
    {"tolerance": 0.0}, {"k_d": 0.0}, {"largest_strain": -1.0}, {"largest_drop": 0.0},
    {"method": "euler"}, {"kappa": ((0.8, 1e-6), (0.7, 1e-7))},
)  # fmt: skip

APART = partial(rods, [[0.0, 0.0], [0.3, 1.2]], [0.0, 1.5], 1.0, 0.5, [6.0, 6.0])


@extreme("", [
    case(f"{IMPLICIT}: crossing spines", crossed, 1e-6, 3.0, expected=CROSS),
    # Faster than their contact holds.
    case(f"{IMPLICIT}: driven until spines cross", APART, 1e2, 3.0, expected=CROSS),
])  # fmt: skip
def test_implicit_stops(scene, kappa, phi_end):
    ended(scene(), Protocol(kappa, phi_end))


def refused(part, settings, changes):
    for name, value in changes:
        shown = f"{value:g}" if settings is Quasistatic else value
        yield case(
            f"{part}: {name} {shown}", settings, name, value, expected=rf"{name} is .*expected"
        )


@extreme("", [
    *refused(IMPLICIT, Protocol, [pair for changes in WRONG for pair in changes.items()]),
    *refused(QUASISTATIC, Quasistatic, (
        ("step", 0.0), ("step", np.inf), ("energy", -1.0), ("tolerance", np.nan), ("closeness", 1.0),
    )),
])  # fmt: skip
def test_wrong_settings(settings, name, value):
    settings(**{name: value})


# --- quasistatic ---------------------------------------------------------------------------------


def first_jammed(packing, protocol, k_e=1.0):
    landscape = Landscape(packing, k_e)
    compression = QuasistaticRun.of(landscape, State.of(packing), protocol)
    for _ in compress_quasistatically(landscape, compression, protocol):
        pass
    return compression


@extreme("residual of the first jammed packing, over the tolerance", [
    *(case(f"{QUASISTATIC}: {name}", scene, 2e-2, heavy=name not in shape.quick_to_jam)
      for shape in SHAPES for name, scene in shape.quasistatic.items()),
    *(case(f"{QUASISTATIC}: steps of {step:g}", partial(loose, 2, 1.0, 2.0), step, heavy=step == 1e-4)
      for step in (1e-4, 0.1, 1.0, 10.0)),
], 1.0)  # fmt: skip
def test_first_jammed_packing(scene, step):
    """Infinite if it is not the first."""
    packing, protocol = scene(), Quasistatic(step=step, energy=1e-8)
    end = first_jammed(packing, protocol)
    per_particle = end.minimum.evaluation.energy / packing.n / protocol.energy
    # Without an energy close to that asked for, it jumps there by a rearrangement.
    is_first = 1 < per_particle <= protocol.closeness or end.phi - end.loose_phi < 1e-8
    residual = end.minimum.residual.largest / protocol.tolerance
    return residual if is_first and end.loose_phi < end.phi else np.inf


@cache
def phi_jammed(length, k_e):
    packing = scaled(loose(2, 1.0, 2.0), length)
    return first_jammed(packing, Quasistatic(step=5e-3, energy=1e-8 * k_e), k_e).phi


@extreme("change of phi_J", [
    case(f"{QUASISTATIC}: length {length:.3g}, k_e {k_e:.3g}", length, k_e) for length, k_e in UNITS
], 1e-12)  # fmt: skip
def test_quasistatic_units(length, k_e):
    return abs(phi_jammed(length, k_e) / phi_jammed(1.0, 1.0) - 1)


@extreme("", [case(f"{QUASISTATIC}: overlaps of a third")],
         "start at phi = .* is jammed .* start at a smaller phi")  # fmt: skip
def test_jammed_start():
    first_jammed(deep(2, 0.0), Quasistatic())


# --- hard particles ------------------------------------------------------------------------------

DISCS_OF_10 = partial(hard, 2, 10.0, 1.0)
SIZES = (1e-12, 1e-6, 1e6)


@extreme("pairs that overlap after 40 sweeps", [
    *(case(f"{THERMAL}: {name}", scene, 0.1, heavy=name in shape.heavy_sweeps)
      for shape in SHAPES for name, scene in shape.hard.items()),
    *(case(f"{THERMAL}: touching, moves of {size:g}", DISCS_OF_10, size) for size in SIZES),
], 0.0)  # fmt: skip
def test_overlaps_after_sweeps(scene, size):
    """All images; infinite if nothing was accepted."""
    thermal, accepted = Thermal(scene(), size=size), 0.0
    for _ in equilibrate(thermal, 40, seed=1):
        accepted += thermal.acceptance
    found = contacts_of(thermal.packing, *every_image(thermal.packing))
    # Between blocks positions are rounded: contacts closer than that may be called overlaps.
    wrong = (found["status"] != TOUCHING) | (np.sqrt(2 * found["energy"]) > 2e-13)
    return wrong.sum() if accepted > 0 else np.inf


@extreme(
    "acceptance less 0.35",
    [case(f"{THERMAL}: moves of {size:g} are led", size) for size in SIZES],
    0.05,
)
def test_acceptance(size):
    """Of 480 sweeps of 12 moves, by binomial noise and the size's own steps."""
    thermal, found = Thermal(hard(2, 1.0, 2.0), size=size), []
    for _ in equilibrate(thermal, 1200, seed=1):
        found.append(thermal.acceptance)  # noqa: PERF401 - the object is the same
    return abs(float(np.mean(found[-40:])) - 0.35)


def swept(length):
    thermal = Thermal(scaled(hard(2, 1.0, 2.0, 0.1), length))
    for _ in equilibrate(thermal, 50, seed=1):
        pass
    return thermal.packing.position / length


@extreme("change of scaled positions", [
    case(f"{THERMAL}: length {length:.3g}", length) for length, _ in UNITS[:2]
], 0.0)  # fmt: skip
def test_thermal_units(length):
    return np.abs(swept(length) - swept(1.0)).max()


def halved(x):
    return 0.5 * x


def coincident(x):
    return np.array([x[0], x[0], *x[2:]])


@extreme("", [
    *(case(f"{THERMAL}: {name}", changed, 0.1, expected="particles overlap, expected a start without overlaps")
      for name, changed in (("overlapping start", halved), ("coincident centres", coincident))),
    *(case(f"{THERMAL}: size {size:g}", np.array, size, expected="size is .*, expected") for size in (0, -1, np.nan)),
])  # fmt: skip
def test_refused_sweeps(changed, size):
    packing = hard(2, 1.0, 2.0, 0.1)
    thermal = Thermal(packing)
    thermal.packing, thermal.size = packing.with_(position=changed(packing.position)), float(size)
    next(equilibrate(thermal, 10, 1))
