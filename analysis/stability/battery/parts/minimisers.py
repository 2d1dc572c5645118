"""Cases of the stability battery: minimisers that need no LAMMPS."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from battery.case import Case
from battery.parts.landscape import UNITS
from battery.parts.targets import ENDED, led
from battery.scenes.elongated import crossed, deep, jammed, rods
from battery.scenes.making import Scene, scaled
from battery.shapes.table import SHAPES
from jamshape.landscape import Landscape, State
from jamshape.minima import Minimum, Outcome, Stop, minimise
from jamshape.minima.minimise import Method
from methods.lbfgs import lbfgs

PART = "minimisers"

# In doubles, and of first order: L-BFGS says that it stalls before 1e-8.
STOPS = {"auto": Stop(), "newton": Stop(), "lbfgs": Stop(tolerance=1e-5)}
METHODS: dict[str, str | Method] = {"auto": "auto", "newton": "newton", "lbfgs": lbfgs}


def _relative(landscape: Landscape, found: Minimum) -> float:
    """Energy density in units of k_e and of the largest of the small lengths."""
    size = float(landscape.inner_radius.max()) ** found.state.dimension
    return found.energy_density * size / landscape.k_e


def minimised(scene: Scene, method: str, stop: Stop) -> float:
    """Residual where it ended; infinite if it gave up, or the energy rose."""
    packing = scene()
    landscape, start = Landscape(packing), State.of(packing)
    before = landscape.evaluate(start).energy
    found = minimise(landscape, start, METHODS[method], stop)
    if not found.evaluation.energy <= before or not np.isfinite(found.residual.largest):
        return np.inf
    if found.outcome is Outcome.UNJAMMED:
        return 0.0
    return found.residual.largest if found.outcome in ENDED else np.inf


def never_worse(scene: Scene, method: str) -> float:
    """Energy after 300 evaluations over that before, whatever the outcome; infinite if not finite."""
    packing = scene()
    landscape, start = Landscape(packing), State.of(packing)
    before = landscape.evaluate(start).energy
    found = minimise(landscape, start, METHODS[method], Stop(evaluations=300))
    position = np.asarray(found.state.position, float)
    fine = np.isfinite(found.residual.largest) and np.isfinite(position).all()
    return found.evaluation.energy / before if fine else np.inf


def in_units(method: str, length: float, k_e: float) -> float:
    """Change of the scaled energy at the minimum, and of the number of evaluations."""
    energies, counts = [], []
    for unit, energy in ((1.0, 1.0), (length, k_e)):
        packing = scaled(jammed(0.0), unit)
        landscape = Landscape(packing, energy)
        found = minimise(landscape, State.of(packing), METHODS[method], STOPS[method])
        if not found.is_at_rest:
            return np.inf
        energies.append(_relative(landscape, found))
        counts.append(landscape.evaluations)
    # Twice the work is no longer the same path.
    change = abs(energies[1] / energies[0] - 1)
    return change if counts[1] <= 2 * counts[0] else np.inf


def faint_in_units(length: float, k_e: float) -> float:
    """Jammed at overlaps of 1e-9: called jammed in any unit, by the default `Stop`."""
    landscape, faint = led("discs", 1e-18)
    there = scaled(faint.state.packing(landscape.particles), length)
    found = minimise(Landscape(there, k_e), State.of(there), "newton", Stop(tolerance=1e-3))
    return found.residual.largest if found.is_at_rest else np.inf


def unjams(method: str, length: float, k_e: float) -> float:
    """Count evaluations to part a few overlapping discs, in other units; infinite if not unjammed."""
    discs = rods([[0.0, 0.0], [0.9, 0.0], [0.4, 0.7]], 0.0, 0.0, 0.5, [20.0, 20.0])
    packing = scaled(discs, length)
    landscape = Landscape(packing, k_e)
    found = minimise(landscape, State.of(packing), METHODS[method], Stop(evaluations=2000))
    return float(landscape.evaluations) if found.outcome is Outcome.UNJAMMED else np.inf


def nothing_touches(method: str) -> float:
    """Count evaluations of a packing without contacts; infinite if that is not called unjammed."""
    packing = rods([[0.0, 0.0], [5.0, 0.0]], 0.0, 1.0, 0.5, [20.0, 20.0])
    landscape = Landscape(packing)
    found = minimise(landscape, State.of(packing), method)
    return float(landscape.evaluations) if found.outcome is Outcome.UNJAMMED else np.inf


def crossing_start(method: str) -> str:
    """Begin with crossing spines."""
    packing = crossed()
    minimise(Landscape(packing), State.of(packing), method)
    return "no sentence"


# --- cases ---------------------------------------------------------------------------------------


def of_scenes() -> Iterator[Case]:
    """List the packings of all shapes."""
    what = "energy after 300 evaluations over that before"
    for shape in SHAPES:
        own = shape.solvers
        for name, scene in own.minimised.items():
            for method in STOPS:
                run = partial(never_worse, scene, method)
                yield Case(PART, f"{name}, {method}", what, 1.0, run)
        for name in own.to_the_end:
            run = partial(minimised, own.minimised[name], "auto", Stop())
            yield Case(PART, f"{name}, to the end", "residual", 1e-8, run)


def of_method(method: str) -> Iterator[Case]:
    """List what a method is tried with, of discs and rods."""
    stop = STOPS[method]
    run = partial(minimised, partial(deep, 2, 0.0), method, stop)
    yield Case(PART, f"discs, overlaps of a third, {method}", "residual", stop.tolerance, run)
    # Energies change by the square of the residual.
    limit = max(1e-12, stop.tolerance**2 * 10)
    for length, k_e in UNITS:
        label, run = (
            f"{method}, length {length:g}, k_e {k_e:g}",
            partial(in_units, method, length, k_e),
        )
        yield Case(PART, label, "change of scaled energy, work at most twice", limit, run)
        label, run = (
            f"{method} parts discs, length {length:g}, k_e {k_e:g}",
            partial(unjams, method, length, k_e),
        )
        yield Case(PART, label, "evaluations", 500, run)
    run = partial(nothing_touches, method)
    yield Case(PART, f"{method}, nothing touches", "evaluations", 1, run)
    words = r"spines of particles \d+ and \d+ cross, expected .*; start from"
    stops: Any = partial(crossing_start, method)
    yield Case(PART, f"{method}, crossing spines", "sentence", words, stops)


def cases() -> list[Case]:
    """All of them."""
    found = [*of_scenes()]
    for method in STOPS:
        found += of_method(method)
    for length, k_e in ((1.0, 1.0), (1e3, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6)):
        run = partial(faint_in_units, length, k_e)
        label = f"overlaps of 1e-9 are jammed, length {length:g}, k_e {k_e:g}"
        found.append(Case(PART, label, "residual", 1e-3, run))
    return found
