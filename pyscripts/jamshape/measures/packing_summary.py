"""Results stored with a minimum, of any shape and dimension: attributes of a packing's file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import BoolArray, FloatArray
from jamshape.contacts import Contacts
from jamshape.files.h5md import read_attributes, write_packing
from jamshape.files.hdf5 import as_read
from jamshape.files.outcomes import is_reached
from jamshape.landscape import Landscape
from jamshape.measures.contact_statistics import contact_scale, residuals
from jamshape.measures.order import order
from jamshape.minima import History, Minimum, residual_of, rounding_floor
from jamshape.packing import Packing
from jamshape.shapes.shape import HARMONIC

# Rows of the convergence history stored in a packing's file.
_REPORT_ROWS = 2000

_SUMMARY = (
    *("alpha", "exponent", "w1", "w2", "kinds", "n", "protocol", "seed", "outcome", "phi", "phi_J"),
    *(
        "phi_J_compression",
        "phi_J_opening",
        "u",
        "energy_per_particle",
        "pressure",
        "z",
        "z_single",
        "z_bearing",
    ),
    *("z_iso", "n_contacts", "n_bonds", "n_rattlers", "S2", "S4", "C4", "asphericity", "beta"),
    *(
        "target_pressure",
        "target_phi",
        "box_yields",
        "stress_error",
        "tries",
        "bordered_eigenvalue",
    ),
    *("residual_force", "residual_torque", "rounding_floor", "evaluations", "wall_seconds"),
)


class Measured(NamedTuple):
    """Measurements of a minimum: numbers, and arrays over particles."""

    attributes: dict[str, float | str]
    observables: dict[str, FloatArray]


def with_results(landscape: Landscape, minimum: Minimum, attributes: Mapping[str, Any]) -> Packing:
    """Return a packing with the results that a file of `write_minimum` has."""
    told = as_read(dict(attributes) | measure(landscape, minimum).attributes)
    return minimum.state.packing(landscape.particles).with_(results=told)


def write_minimum(
    path: Path, landscape: Landscape, minimum: Minimum, attributes: Mapping[str, Any]
) -> None:
    """Write a packing with all its measurements."""
    packing = minimum.state.packing(landscape.particles)
    measured = measure(landscape, minimum)
    told, report = dict(attributes) | measured.attributes, thinned(minimum.history)
    write_packing(path, packing, told, measured.observables, report)


def measure(landscape: Landscape, minimum: Minimum) -> Measured:
    """Measure a minimum.

    Parameters
    ----------
    landscape : Landscape
    minimum : Minimum

    Returns
    -------
    Measured
        `residual_force` and `residual_torque` are the largest of all non-rattlers over the
        mean bond force (torques also over the length that scales radians); `residual` is the
        largest of all particles. z counts bonds, z_bearing those that bear at least 1e-6 of the mean
        force, z_single contacts.
    """
    packing = minimum.state.packing(landscape.particles)
    found = Contacts.of(packing, landscape.k_e, landscape.sides)
    u, D = minimum.energy_density, packing.dimension
    pressure = -minimum.evaluation.strain_gradient / (D * minimum.state.volume)
    attributes: dict[str, float | str] = {
        "outcome": minimum.outcome.value,
        "phi": packing.phi,
        "phi_J": energy_onset(packing.phi, u, pressure, packing.law.power),
        "u": u,
        "energy_per_particle": minimum.evaluation.energy / packing.n,
        "pressure": pressure,
        **_residuals(landscape, minimum, found.rattlers),
        **found.counts._asdict(),
        "z_iso": packing.z_iso,
        **order(packing),
    }
    attributes |= packing.shape.described(packing.diameters, packing.form, D)
    rattler_ids = packing.id[found.rattlers].astype(np.float64)
    return Measured(attributes, {"rattler_ids": rattler_ids} | _net(landscape, minimum, found))


def _residuals(
    landscape: Landscape, minimum: Minimum, rattlers: BoolArray
) -> dict[str, float | str]:
    evaluation = minimum.evaluation
    held = landscape.components(evaluation.gradient)
    held[rattlers] = 0.0
    residual = residual_of(landscape, evaluation._replace(gradient=landscape.coordinates(held)))
    return {
        "residual_force": residual.force,
        "residual_torque": residual.torque,
        "residual": minimum.residual.largest,
        "rounding_floor": rounding_floor(evaluation, landscape),
    }


def _net(landscape: Landscape, minimum: Minimum, found: Contacts) -> dict[str, FloatArray]:
    """Net force and torque of each particle over their averages, in two dimensions."""
    packing, D = landscape.particles, minimum.state.dimension
    held = ~found.rattlers[found.network.pairs].any(axis=1)
    if D != 2 or not held.any():
        return {}
    at = minimum.state.packing(packing)
    gradient = landscape.components(minimum.evaluation.gradient)
    torque = gradient[:, D] * landscape.rotation_length
    scale = contact_scale(at, found.network, found.rattlers)
    net = residuals(gradient[:, :D], torque, scale, found.rattlers)
    return {"net_force": net.force, "net_torque": net.torque}


def energy_onset(phi: float, u: float, pressure: float, power: float = HARMONIC) -> float:
    """Extrapolate phi to where r = u^(1/A), linear in phi, vanishes, A the power of the overlap in the energy of a contact.

    u = U / V and dU/dV = -p; with V = const / phi at fixed particles, du/dphi = (p + u) / phi, and dr/dphi = r / (A u) of it.
    """
    return phi - power * phi * u / (pressure + u) if u > 0 else math.nan


def thinned(history: History) -> tuple[list[int], list[float], list[float]]:
    """Thin out a history for a report: evaluations, seconds, residuals."""
    rows = np.unique(np.linspace(0, len(history.residual) - 1, _REPORT_ROWS).astype(int))
    picked = zip(
        *((history.evaluations[r], history.wall_seconds[r], history.residual[r]) for r in rows),
        strict=True,
    )
    steps, seconds, errors = map(list, picked)
    return steps, seconds, errors


def summary_of(out: Path, names: Iterable[str] = _SUMMARY) -> dict[str, Any]:
    """Return attributes of a finished packing, None for NaN, and whether it reached its goal."""
    stored = read_attributes(out)
    found = {name: stored[name] for name in names if name in stored}
    tidy = {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in found.items()}
    return {"out": str(out), **tidy, "reached": is_reached(stored)}
