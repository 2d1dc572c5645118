"""Minimisers: LAMMPS's with our pair styles, and those that need no LAMMPS."""

from functools import partial

import numpy as np
from energy_targets import ENDED, led
from extreme import case, extreme
from extreme_in_lammps import frame, loaded, measured
from extreme_rods import crossed, deep, jammed, rods
from extreme_shapes import SHAPES
from packings_in_a_box import scaled
from test_extreme_landscape import UNITS

from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.minima import Outcome, Stop, minimise
from methods.lbfgs import lbfgs

PART = "minimisers"

# In doubles, and of first order: L-BFGS says that it stalls before 1e-8.
STOPS = {"auto": Stop(), "newton": Stop(), "lbfgs": Stop(tolerance=1e-5)}
METHODS = {"lbfgs": lbfgs}


# --- LAMMPS --------------------------------------------------------------------------------------


@extreme("energy over that before", [
    # The deep one has been minimised before; all others must gain.
    case(f"LAMMPS minimize, {shape.name}: {name}, {style}, line {line}", scene, shape.laws[-1].sides, style, line,
         expected=1.0 if "third" in name else 0.99)
    for shape in SHAPES for name, scene in shape.minimised_by_lammps.items()
    for style in ("cg", "sd") for line in ("quadratic", "backtrack")
])  # fmt: skip
def test_lammps_minimize(scene, sides, style, line):
    """50 iterations."""
    packing = scene()
    search = f"min_style {style}\nmin_modify dmax 0.1 line {line}"
    with loaded(packing, search, sides=sides) as session:
        session.commands("run 0")
        before = measured(session, "energy")
        session.commands("minimize 0 1e-300 50 500\nrun 0")
        after, at = measured(session, "energy"), frame(session, packing)
    is_finite = np.isfinite(at.force).all() and np.isfinite(at.torque).all()
    return after / before if is_finite else np.inf


@extreme("change of scaled p and of phi", [
    case(f"compression from Python: length {length:g}, k_e {k_e:g}", length, k_e)
    for length, k_e in ((1e-3, 1.0), (1e3, 1.0), (1.0, 1e-6), (1.0, 1e6))
], 1e-8)  # fmt: skip
def test_compression_from_python(length, k_e):
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
            found.append((at["phi"], at["pressure"] * unit**2 / energy))
    (phi, p), (phi_there, p_there) = found
    return max(abs(phi_there / phi - 1), abs(p_there / p - 1))


# --- without LAMMPS ------------------------------------------------------------------------------


def minimised(packing, method, stop, k_e=1.0):
    landscape = Landscape(packing, k_e)
    return landscape, minimise(landscape, State.of(packing), METHODS.get(method, method), stop)


@extreme("residual", [
    *(case(f"{PART}: {name}, to the end", shape.minimised[name], "auto", expected=1e-8)
      for shape in SHAPES for name in shape.to_the_end),
    *(case(f"{PART}: discs, overlaps of a third, {method}", partial(deep, 2, 0.0), method, expected=stop.tolerance)
      for method, stop in STOPS.items()),
])  # fmt: skip
def test_residual(scene, method):
    """Infinite if it gave up, or the energy rose."""
    packing = scene()
    before = Landscape(packing).evaluate(State.of(packing)).energy
    _, found = minimised(packing, method, STOPS[method])
    if not found.evaluation.energy <= before or not np.isfinite(found.residual.largest):
        return np.inf
    if found.outcome is Outcome.UNJAMMED:
        return 0.0
    return found.residual.largest if found.outcome in ENDED else np.inf


@extreme("energy after 300 evaluations over that before", [
    case(f"{PART}: {name}, {method}", scene, method)
    for shape in SHAPES for name, scene in shape.minimised.items() for method in STOPS
], 1.0)  # fmt: skip
def test_never_worse(scene, method):
    """Whatever the outcome."""
    packing = scene()
    before = Landscape(packing).evaluate(State.of(packing)).energy
    _, found = minimised(packing, method, Stop(evaluations=300))
    position = np.asarray(found.state.position, float)
    fine = np.isfinite(found.residual.largest) and np.isfinite(position).all()
    return found.evaluation.energy / before if fine else np.inf


@extreme("change of scaled energy, work at most twice", [
    # Energies change by the square of the residual.
    case(f"{PART}: {method}, length {length:g}, k_e {k_e:g}", method, length, k_e,
         expected=max(1e-12, stop.tolerance**2 * 10))
    for method, stop in STOPS.items() for length, k_e in UNITS
])  # fmt: skip
def test_units(method, length, k_e):
    energies, counts = [], []
    for unit, energy in ((1.0, 1.0), (length, k_e)):
        landscape, found = minimised(scaled(jammed(0.0), unit), method, STOPS[method], energy)
        if not found.is_at_rest:
            return np.inf
        size = float(landscape.inner_radius.max()) ** found.state.dimension
        energies.append(found.energy_density * size / energy)
        counts.append(landscape.evaluations)
    # Twice the work is no longer the same path.
    return abs(energies[1] / energies[0] - 1) if counts[1] <= 2 * counts[0] else np.inf


@extreme("residual", [
    case(f"{PART}: overlaps of 1e-9 are jammed, length {length:g}, k_e {k_e:g}", length, k_e)
    for length, k_e in ((1.0, 1.0), (1e3, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6))
], 1e-3)  # fmt: skip
def test_faint_contacts_are_jammed(length, k_e):
    """In any unit, by the default `Stop`."""
    landscape, faint = led("discs", 1e-18)
    there = scaled(faint.state.packing(landscape.particles), length)
    _, found = minimised(there, "newton", Stop(tolerance=1e-3), k_e)
    return found.residual.largest if found.is_at_rest else np.inf


@extreme("evaluations", [
    case(f"{PART}: {method} parts discs, length {length:g}, k_e {k_e:g}", method, length, k_e)
    for method in STOPS for length, k_e in UNITS
], 500)  # fmt: skip
def test_overlapping_discs_part(method, length, k_e):
    discs = rods([[0.0, 0.0], [0.9, 0.0], [0.4, 0.7]], 0.0, 0.0, 0.5, [20.0, 20.0])
    landscape, found = minimised(scaled(discs, length), method, Stop(evaluations=2000), k_e)
    return landscape.evaluations if found.outcome is Outcome.UNJAMMED else np.inf


@extreme("evaluations", [case(f"{PART}: {method}, nothing touches", method) for method in STOPS], 1)
def test_nothing_touches(method):
    packing = rods([[0.0, 0.0], [5.0, 0.0]], 0.0, 1.0, 0.5, [20.0, 20.0])
    landscape, found = minimised(packing, method, Stop())
    return landscape.evaluations if found.outcome is Outcome.UNJAMMED else np.inf


@extreme("", [case(f"{PART}: {method}, crossing spines", method) for method in STOPS],
         r"spines of particles \d+ and \d+ cross, expected .*; start from")  # fmt: skip
def test_crossing_start(method):
    minimised(crossed(), method, Stop())
