"""Cases of the stability battery: compressions without LAMMPS, implicit, quasistatic and thermal."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from stability_cases import Case
from stability_contacts import RODS
from stability_scenes import (
    all_aspect_ratios,
    deep,
    every_image,
    in_doubles,
    jammed,
    rods,
    scaled,
    scattered_superellipsoids,
    stack,
)

from jamshape import _contact
from jamshape.contacts import superellipsoid_bodies
from jamshape.flow.implicit import METHODS, Flow, Protocol, Step, compress
from jamshape.landscape import Landscape, State
from jamshape.minima import minimise
from jamshape.packing import Packing
from jamshape.protocols.quasistatic import Quasistatic, QuasistaticRun
from jamshape.protocols.quasistatic import compress as compress_quasistatically
from jamshape.protocols.thermal import Thermal, equilibrate, without_overlaps

IMPLICIT, QUASISTATIC, THERMAL = (
    "implicit compression",
    "quasistatic compression",
    "hard Monte Carlo",
)

_CROSS = r"(spines|centres) of particles \d+ and \d+ cross"

# Powers of two near 1e-6 and 1e6: all of a computation without a hidden unit is then the same to the bit.
UNITS = ((2.0**-20, 1.0), (2.0**20, 1.0), (1.0, 2.0**-20), (1.0, 2.0**20))

TOLERANCE = 1e-3


class Ended(NamedTuple):
    """A compression at its end."""

    landscape: Landscape
    flow: Flow
    steps: list[Step]


def ended(packing: Packing, protocol: Protocol, k_e: float = 1.0) -> Ended:
    """Compress to the end."""
    landscape, flow = Landscape(packing, k_e), Flow(State.of(packing))
    return Ended(landscape, flow, list(compress(landscape, flow, protocol)))


# --- implicit ------------------------------------------------------------------------------------


def two_discs(overlap: float) -> Packing:
    """Their overlap x obeys dx/dt = kappa (1 - x) - 2 x / (k_d area), in units of k_e and d."""
    return rods([[-1.0, 0.0], [-overlap, 0.0]], 0.0, 0.0, 0.5, [10.0, 10.0])


_RATE = 2 / (np.pi / 4)


def _relaxed(overlap: float, kappa: float, t: float) -> float:
    steady = kappa / (_RATE + kappa)
    return steady + (overlap - steady) * float(np.exp(-(_RATE + kappa) * t))


def _overlap(flow: Flow) -> float:
    x = flow.state.position[:, 0]
    return float(1 - abs(x[1] - x[0]))


def driven_contact(kappa: float, method: str, start: float) -> float:
    """Overlap from a multiple of the steady one on, over the local errors of all steps."""
    overlap = start * kappa / (_RATE + kappa)
    packing = two_discs(overlap)
    strain = min(max(10 * kappa / _RATE, 1e-8), 0.05)
    phi_end = packing.phi * np.exp(2 * strain)
    _, flow, steps = ended(packing, Protocol(kappa, phi_end, tolerance=TOLERANCE, method=method))
    exact = _relaxed(overlap, kappa, flow.time)
    return abs(_overlap(flow) / exact - 1) / (len(steps) * TOLERANCE)


def rates_changed(factor: float) -> float:
    """Kappa changed by this factor and back while a contact follows, over the local errors."""
    slow, packing = 1e-2 / factor, two_discs(1e-2 / (_RATE + 1e-2))
    phi = packing.phi * np.exp(2 * np.array([0.0, 1e-2, 1e-2 + 20 * slow, 3e-2]))
    rates = ((0.0, 1e-2), (float(phi[1]), slow), (float(phi[2]), 1e-2))
    _, flow, steps = ended(packing, Protocol(rates, float(phi[3]), tolerance=TOLERANCE))
    exact, strain = _overlap(Flow(State.of(packing))), 0.5 * np.log(phi / packing.phi)
    for (_, kappa), part in zip(rates, np.diff(strain), strict=True):
        exact = _relaxed(exact, kappa, part / kappa)
    return abs(_overlap(flow) / exact - 1) / (len(steps) * TOLERANCE)


@cache
def _begun(alpha: float) -> Packing:
    """Twelve rods or discs just above jamming, minimised."""
    packing = jammed(alpha, 12, 0.86)
    found = minimise(Landscape(packing), State.of(packing))
    return in_doubles(found.state.packing(packing))


def _in_units(length: float, k_e: float, k_d: float) -> Ended:
    t0, packing = k_d * length**4 / k_e, scaled(_begun(1.0), length)
    protocol = Protocol(2.0**-20 / t0, _begun(1.0).phi * 1.01, k_d=k_d)
    return ended(packing, protocol, k_e)


@cache
def _reference() -> Ended:
    return _in_units(1.0, 1.0, 1.0)


def implicit_in_units(length: float, k_e: float, k_d: float) -> float:
    """Change of all scaled pressures by units that are powers of two; infinite if steps differ."""
    a, b = (found.steps for found in (_reference(), _in_units(length, k_e, k_d)))
    if len(a) != len(b):
        return np.inf
    p, there = (np.array([step.p for step in steps]) for steps in (a, b))
    return float(np.abs(there * length**2 / k_e / p - 1).max())


def two_tolerances(scene: Callable[[], Packing], kappa: float, strain: float) -> float:
    """Energy at a tolerance against that at a thirtieth, over the local errors of all steps."""
    packing = scene()
    phi_end, found = packing.phi * np.exp(2 * strain), []
    for tolerance in (TOLERANCE, TOLERANCE / 30):
        protocol = Protocol(kappa, phi_end, tolerance=tolerance)
        found.append(ended(packing, protocol).steps)
    coarse, fine = found
    return abs(coarse[-1].u / fine[-1].u - 1) / (len(coarse) * TOLERANCE)


_EVENTFUL = Protocol(1e-8, 0.86, tolerance=1e-2)


@cache
def _plastic() -> tuple[Packing, int]:
    """Give a packing that rearranges while it is compressed, and the step at which its energy falls most."""
    packing = jammed(4.0, 16, 0.8)
    u = np.array([step.u for step in ended(packing, _EVENTFUL).steps])
    return packing, 1 + int((u[1:] / u[:-1]).argmin())


def stopped_in_an_event() -> float:
    """Stop where the energy falls fastest and go on from public fields: change of the end, exactly."""
    packing, event = _plastic()
    landscape, flow = Landscape(packing), Flow(State.of(packing))
    fallen = []
    for step in compress(landscape, flow, _EVENTFUL):
        fallen.append(step.u)
        if step.step == event:
            flow.forget()
            fresh = Flow(**{k: v for k, v in vars(flow).items() if not k.startswith("_")})
    rest = list(compress(Landscape(packing), fresh, _EVENTFUL))
    falls = min(b / a for a, b in itertools.pairwise(fallen))
    if falls > 0.9 or rest[0].step != event + 1:
        return np.inf
    return float(np.abs(fresh.state.position - flow.state.position).max())


def energy_lost_in_a_step(drop: float) -> float:
    """Largest part of the energy that a step loses with such a `largest_drop`, over it."""
    packing, _ = _plastic()
    u = np.array([s.u for s in ended(packing, replace(_EVENTFUL, largest_drop=drop)).steps])
    # Not of energies to which drag pushes a contact at this rate.
    above = u[:-1] > 1e-12
    return float((1 - u[1:] / u[:-1])[above].max()) / drop


def beyond(kappa: float) -> float:
    """Compress overlaps of a third by another tenth of phi: energy over that of affine motion."""
    packing = deep(2, 0.0)
    landscape, flow, _ = ended(packing, Protocol(kappa, 1.1 * packing.phi))
    start = State.of(packing)
    affine = start.strained(float(flow.state.edges[0] / start.edges[0]) - 1)
    return landscape.evaluate(flow.state).energy / landscape.evaluate(affine).energy


def _crossing(kappa: float) -> str:
    """Drive two rods across each other, faster than their contact holds, or begin with crossing ones."""
    apart = rods([[0.0, 0.0], [0.3, 1.2]], [0.0, 1.5], 1.0, 0.5, [6.0, 6.0])
    crossed = rods([[0.0, 0.0], [0.1, 0.2]], [0.0, 1.5], 1.0, 0.5, [12.0, 12.0])
    ended(apart if kappa > 1 else crossed, Protocol(kappa, 3.0))
    return "no sentence"


def _told(changes: dict[str, object]) -> str:
    Protocol(**changes)  # type: ignore[arg-type]
    return "no sentence"


def _in_space() -> str:
    ended(RODS["3D, own images"](), Protocol(1e-6, 2.0))
    return "no sentence"


def implicit_cases() -> list[Case]:
    """List what the implicit integrator must stand."""
    found = []
    local = "error of the overlap, over local errors of all steps"
    for kappa in (1e-14, 1e-10, 1e-6, 1e-2, 1.0, 1e2):
        for method in METHODS:
            for start in (1.0, 10.0) if kappa < 1e-1 else (0.02,):
                run = partial(driven_contact, kappa, method, start)
                label = f"kappa {kappa:g}, {method}, from {start:g} of the steady overlap"
                found.append(Case(IMPLICIT, label, local, 1.0, run))
    for factor in (1e3, 1e6, 1e12):
        run = partial(rates_changed, factor)
        found.append(Case(IMPLICIT, f"rates changed by {factor:g}", local, 1.0, run))
    units = [(*unit, 1.0) for unit in UNITS] + [(1.0, 1.0, 2.0**-20), (1.0, 1.0, 2.0**20)]
    for length, k_e, k_d in units:
        run = partial(implicit_in_units, length, k_e, k_d)
        label = f"length {length:.3g}, k_e {k_e:.3g}, k_d {k_d:.3g}"
        found.append(Case(IMPLICIT, label, "change of scaled pressures", 1e-12, run))
    scenes: dict[str, Callable[[], Packing]] = {
        "alpha 1e-6 to 100 in one box": partial(all_aspect_ratios, 2),
        "own images": RODS["own images"],
        "overlaps of a third": partial(deep, 2),
        "stack to 1e-6": partial(stack, 1e-6, 2),
        "stack to 1e-14": partial(stack, 1e-14, 2),
    }
    what = "energy at two tolerances, over local errors"
    for name, scene in scenes.items():
        run = partial(two_tolerances, scene, 1e-2, 1e-3)
        found.append(Case(IMPLICIT, name, what, 1.0, run))
    for kappa in (1e-10, 1e-2):
        # What relaxes has less energy than what moves with the box.
        label, run = f"overlaps of a third and beyond, kappa {kappa:g}", partial(beyond, kappa)
        found.append(Case(IMPLICIT, label, "energy over that of affine motion", 1.0, run))
    label = "stopped within a plastic event"
    found.append(Case(IMPLICIT, label, "distance from going on", 0.0, stopped_in_an_event, True))
    for drop in (0.3, 0.03):
        label, run = f"largest_drop {drop:g}", partial(energy_lost_in_a_step, drop)
        found.append(Case(IMPLICIT, label, "energy lost in a step over it", 1.01, run, heavy=True))
    for kappa, name in ((1e-6, "crossing spines"), (1e2, "driven until spines cross")):
        found.append(Case(IMPLICIT, name, "sentence", _CROSS, partial(_crossing, kappa)))
    found.append(Case(IMPLICIT, "3D", "sentence", r"dimensions, expected (2|two)", _in_space))
    wrong = ({"kappa": 0.0}, {"kappa": -1e-6}, {"kappa": np.nan}, {"phi_end": -1.0}, {"phi_end": np.nan},
             {"tolerance": 0.0}, {"k_d": 0.0}, {"largest_strain": -1.0}, {"largest_drop": 0.0},
             {"method": "euler"}, {"kappa": ((0.8, 1e-6), (0.7, 1e-7))})  # fmt: skip
    for changes in wrong:
        name, value = next(iter(changes.items()))
        run_there = partial(_told, dict(changes))
        found.append(Case(IMPLICIT, f"{name} {value}", "sentence", rf"{name} is .*expected", run_there))  # fmt: skip
    return found


# --- quasistatic ---------------------------------------------------------------------------------


@cache
def _loose(dimension: int, p: float, w: float, n: int = 8) -> Packing:
    """Particles of one shape, moved apart in a box that leaves them room."""
    packing = scattered_superellipsoids((p,), (w,), dimension, 1e-3, n)
    return in_doubles(State.of(packing).strained(0.02).packing(packing))


def _first_jammed(packing: Packing, protocol: Quasistatic, k_e: float = 1.0) -> tuple[float, ...]:
    """Give its phi, U/N over the energy asked for, the residual, and the densest loose phi."""
    landscape = Landscape(packing, k_e)
    compression = QuasistaticRun.of(landscape, State.of(packing), protocol)
    for _ in compress_quasistatically(landscape, compression, protocol):
        pass
    assert compression.minimum is not None
    per_particle = compression.minimum.evaluation.energy / packing.n / protocol.energy
    residual = compression.minimum.residual.largest
    return compression.phi, per_particle, residual, compression.loose_phi


def quasistatic_end(packing: Callable[[], Packing], step: float) -> float:
    """Residual of the first jammed packing over the tolerance; infinite if it is not one."""
    protocol = Quasistatic(step=step, energy=1e-8)
    phi, per_particle, residual, loose = _first_jammed(packing(), protocol)
    # Without an energy close to that asked for, it jumps there by a rearrangement.
    is_first = 1 < per_particle <= protocol.closeness or phi - loose < 1e-8
    return residual / protocol.tolerance if is_first and loose < phi else np.inf


def _jammed_in(length: float, k_e: float) -> float:
    packing = scaled(_loose(2, 1.0, 2.0), length)
    return _first_jammed(packing, Quasistatic(step=5e-3, energy=1e-8 * k_e), k_e)[0]


@cache
def _jammed_here() -> float:
    return _jammed_in(1.0, 1.0)


def quasistatic_in_units(length: float, k_e: float) -> float:
    """Change of phi_J by units that are powers of two."""
    return abs(_jammed_in(length, k_e) / _jammed_here() - 1)


def _jammed_start() -> str:
    _first_jammed(deep(2, 0.0), Quasistatic())
    return "no sentence"


def _asked(changes: dict[str, float]) -> str:
    Quasistatic(**changes)  # type: ignore[arg-type]
    return "no sentence"


def quasistatic_cases() -> list[Case]:
    """List what protocol 1 must stand."""
    found, what = [], "residual of the first jammed packing, over the tolerance"
    for dimension in (2, 3):
        for p in (0.55, 1.0, 10.0):
            for w in (0.1, 1.0, 10.0):
                run = partial(quasistatic_end, partial(_loose, dimension, p, w), 2e-2)
                heavy = dimension == 3 or (p, w) != (1.0, 1.0)
                found.append(Case(QUASISTATIC, f"{dimension}D, p {p:g}, w {w:g}", what, 1.0, run, heavy))  # fmt: skip
    for step in (1e-4, 0.1, 1.0, 10.0):
        run = partial(quasistatic_end, partial(_loose, 2, 1.0, 2.0), step)
        found.append(Case(QUASISTATIC, f"steps of {step:g}", what, 1.0, run, heavy=step == 1e-4))
    for length, k_e in UNITS:
        label, run = (
            f"length {length:.3g}, k_e {k_e:.3g}",
            partial(quasistatic_in_units, length, k_e),
        )
        found.append(Case(QUASISTATIC, label, "change of phi_J", 1e-12, run))
    words = "start at phi = .* is jammed .* start at a smaller phi"
    found.append(Case(QUASISTATIC, "overlaps of a third", "sentence", words, _jammed_start))
    for name, value in (("step", 0.0), ("step", np.inf), ("energy", -1.0), ("tolerance", np.nan),
                        ("closeness", 1.0)):  # fmt: skip
        run_there = partial(_asked, {name: value})
        found.append(Case(QUASISTATIC, f"{name} {value:g}", "sentence", rf"{name} is .*expected", run_there))  # fmt: skip
    return found


# --- thermal -------------------------------------------------------------------------------------


@cache
def _hard(dimension: int, p: float, w: float, wider: float = 0.0) -> Packing:
    """Particles without overlaps in a box twice as wide as they are long; touching unless `wider`."""
    n = max(12, int(8 * max(w, 1 / w) ** (dimension - 1))) if dimension == 2 else 12
    packing = _loose(dimension, p, w, min(n, 60))
    longest = 2 * float(_contact.superellipsoid_bounding_radius(
        packing.diameters, packing.exponent, dimension).max())  # fmt: skip
    strain = max(wider, 2.001 * longest / float(packing.box.edges.min()) - 1)
    return without_overlaps(in_doubles(State.of(packing).strained(strain).packing(packing)))


def overlaps_after(packing: Callable[[], Packing], size: float, sweeps: int = 40) -> float:
    """Pairs that overlap after some sweeps, over all images; infinite if nothing was accepted."""
    thermal, accepted = Thermal(packing(), size=size), 0.0
    for _ in equilibrate(thermal, sweeps, seed=1):
        accepted += thermal.acceptance
    pairs, shift = every_image(thermal.packing)
    rows, D = superellipsoid_bodies(thermal.packing), thermal.packing.dimension
    j = rows[pairs[:, 1]].copy()
    j[:, :D] += shift * thermal.packing.box.edges
    # Between blocks positions are rounded: contacts closer than that may be called overlaps.
    eta = _contact.superellipsoid_scales(np.ascontiguousarray(rows[pairs[:, 0]]), j)["eta"]
    return float((eta < 1 - 1e-13).sum()) if accepted > 0 else np.inf


def acceptance_error(size: float) -> float:
    """Distance of the acceptance from 0.35 after steps of any size were led there."""
    thermal, found = Thermal(_hard(2, 1.0, 2.0), size=size), []
    for _ in equilibrate(thermal, 1200, seed=1):
        found.append(thermal.acceptance)  # noqa: PERF401 - the object is the same
    return abs(float(np.mean(found[-40:])) - 0.35)


def thermal_in_units(length: float) -> float:
    """Change of scaled positions by a unit that is a power of two."""
    start, ends = _hard(2, 1.0, 2.0, 0.1), []
    for unit in (1.0, length):
        thermal = Thermal(scaled(start, unit))
        for _ in equilibrate(thermal, 50, seed=1):
            pass
        ends.append(thermal.packing.position / unit)
    return float(np.abs(ends[1] - ends[0]).max())


def _refused(change: str) -> str:
    packing = _hard(2, 1.0, 2.0, 0.1)
    thermal = Thermal(packing)
    if change == "overlapping start":
        thermal.packing = packing.with_(position=0.5 * packing.position)
    elif change == "coincident centres":
        x = packing.position.copy()
        x[1] = x[0]
        thermal.packing = packing.with_(position=x)
    elif change == "rods":
        thermal.packing = rods([[0.0, 0.0], [3.0, 0.0]], 0.0, 0.5, 0.5, [12.0, 12.0])
    else:
        thermal.size = float(change.removeprefix("size "))
    next(equilibrate(thermal, 10, 1))
    return f"no sentence, size {thermal.size:g}"


def thermal_cases() -> list[Case]:
    """List what Monte Carlo of hard particles must stand."""
    found, what = [], "pairs that overlap after 40 sweeps"
    for dimension in (2, 3):
        for p in (0.55, 1.0, 10.0):
            for w in (0.1, 1.0, 10.0):
                run = partial(overlaps_after, partial(_hard, dimension, p, w), 0.1)
                label = f"{dimension}D, p {p:g}, w {w:g}"
                found.append(Case(THERMAL, label, what, 0.0, run, dimension == 3 and w != 1))
    for size in (1e-12, 1e-6, 1e6):
        run = partial(overlaps_after, partial(_hard, 2, 10.0, 1.0), size)
        found.append(Case(THERMAL, f"touching, moves of {size:g}", what, 0.0, run))
        run = partial(acceptance_error, size)
        # Of 480 sweeps of 12 moves, by binomial noise and the size's own steps.
        found.append(Case(THERMAL, f"moves of {size:g} are led", "acceptance less 0.35", 0.05, run))
    for length, _ in UNITS[:2]:
        label, run = f"length {length:.3g}", partial(thermal_in_units, length)
        found.append(Case(THERMAL, label, "change of scaled positions", 0.0, run))
    overlap, no_size = (
        "particles overlap, expected a start without overlaps",
        "size is .*, expected",
    )
    sentences = {"overlapping start": overlap, "coincident centres": overlap,
                 "rods": "expected superellipsoids", "size 0": no_size, "size -1": no_size, "size nan": no_size}  # fmt: skip
    for name, words in sentences.items():
        found.append(Case(THERMAL, name, "sentence", words, partial(_refused, name)))
    return found


def cases() -> list[Case]:
    """All of them."""
    return [*implicit_cases(), *quasistatic_cases(), *thermal_cases()]
