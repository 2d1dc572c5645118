"""Cases of the stability battery: implicit compressions."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from battery.case import Case
from battery.parts.landscape import CROSS
from battery.scenes.elongated import crossed, deep, jammed, own_images, rods
from battery.scenes.making import Scene, in_doubles, scaled
from battery.shapes.table import SHAPES
from jamshape.flow.implicit import METHODS, Flow, Protocol, Step, compress
from jamshape.landscape import Landscape, State
from jamshape.minima import minimise
from jamshape.packing import Packing

PART = "implicit compression"

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
    p, there = (np.array([step.pressure for step in steps]) for steps in (a, b))
    there, some = there * length**2 / k_e, p > 0
    if ((there > 0) != some).any():
        return np.inf
    return float(np.abs(there[some] / p[some] - 1).max())


def two_tolerances(scene: Scene, kappa: float, strain: float) -> float:
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
    ended(apart if kappa > 1 else crossed(), Protocol(kappa, 3.0))
    return "no sentence"


def _told(changes: dict[str, Any]) -> str:
    Protocol(**changes)
    return "no sentence"


def _in_space() -> str:
    ended(own_images(3), Protocol(1e-6, 2.0))
    return "no sentence"


# --- cases ---------------------------------------------------------------------------------------

# Each refused with its name.
WRONG = (
    {"kappa": 0.0}, {"kappa": -1e-6}, {"kappa": np.nan}, {"phi_end": -1.0}, {"phi_end": np.nan},
    {"tolerance": 0.0}, {"k_d": 0.0}, {"largest_strain": -1.0}, {"largest_drop": 0.0},
    {"method": "euler"}, {"kappa": ((0.8, 1e-6), (0.7, 1e-7))},
)  # fmt: skip


def of_one_contact() -> Iterator[Case]:
    """List rates, and their changes, of two discs."""
    local = "error of the overlap, over local errors of all steps"
    for kappa in (1e-14, 1e-10, 1e-6, 1e-2, 1.0, 1e2):
        for method in METHODS:
            for start in (1.0, 10.0) if kappa < 1e-1 else (0.02,):
                run = partial(driven_contact, kappa, method, start)
                label = f"kappa {kappa:g}, {method}, from {start:g} of the steady overlap"
                yield Case(PART, label, local, 1.0, run)
    for factor in (1e3, 1e6, 1e12):
        yield Case(PART, f"rates changed by {factor:g}", local, 1.0, partial(rates_changed, factor))


def of_packings() -> Iterator[Case]:
    """List units, and packings of all shapes."""
    units = [(*unit, 1.0) for unit in UNITS] + [(1.0, 1.0, 2.0**-20), (1.0, 1.0, 2.0**20)]
    for length, k_e, k_d in units:
        run = partial(implicit_in_units, length, k_e, k_d)
        label = f"length {length:.3g}, k_e {k_e:.3g}, k_d {k_d:.3g}"
        yield Case(PART, label, "change of scaled pressures", 1e-12, run)
    for shape in SHAPES:
        for name, scene in shape.compressed.implicit.items():
            run = partial(two_tolerances, scene, 1e-2, 1e-3)
            yield Case(PART, name, "energy at two tolerances, over local errors", 1.0, run)
    for kappa in (1e-10, 1e-2):
        # What relaxes has less energy than what moves with the box.
        label, run = f"overlaps of a third and beyond, kappa {kappa:g}", partial(beyond, kappa)
        yield Case(PART, label, "energy over that of affine motion", 1.0, run)


def of_events() -> Iterator[Case]:
    """List plastic events."""
    label = "stopped within a plastic event"
    yield Case(PART, label, "distance from going on", 0.0, stopped_in_an_event, True)
    for drop in (0.3, 0.03):
        label, run = f"largest_drop {drop:g}", partial(energy_lost_in_a_step, drop)
        yield Case(PART, label, "energy lost in a step over it", 1.01, run, heavy=True)


def of_stops() -> Iterator[Case]:
    """List what ends with a sentence."""
    for kappa, name in ((1e-6, "crossing spines"), (1e2, "driven until spines cross")):
        yield Case(PART, name, "sentence", CROSS, partial(_crossing, kappa))
    yield Case(PART, "3D", "sentence", r"dimensions, expected (2|two)", _in_space)
    for changes in WRONG:
        name, value = next(iter(changes.items()))
        run = partial(_told, dict(changes))
        yield Case(PART, f"{name} {value}", "sentence", rf"{name} is .*expected", run)


def cases() -> list[Case]:
    """All of them."""
    return [*of_one_contact(), *of_packings(), *of_events(), *of_stops()]
