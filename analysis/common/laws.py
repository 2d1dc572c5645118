"""Packings of discs under several laws of contacts, at rising distances from jamming, in files that are kept."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np

import jamshape as js
from jamshape.checks import NotReachedWarning
from jamshape.landscape import Landscape, State
from jamshape.shapes.particles import Particles
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import DynamicalMatrix, dynamical_matrix

COMPRESSED = "common.laws:compressed"
"""Name of the function that makes the packings of a `Series`."""


class Series(NamedTuple):
    """Packings of discs in 2D, of one seed and law, at several energies."""

    law: str
    n: int
    seed: int
    overlaps: tuple[float, ...]
    """Ascending; the energy is that of one such overlap for each unit of area."""

    @property
    def file(self) -> str:
        """Name of the file of its results."""
        span = f"x{self.overlaps[0]:.3g}_{self.overlaps[-1]:.3g}_{len(self.overlaps)}"
        return f"discs_{self.law.replace(' ', '-')}_n{self.n}_{span}_s{self.seed}.json"


def compressed(*series: Any) -> list[dict[str, Any]]:
    """Make the packing of a `Series` at its lowest energy, raise the energy, and measure at each."""
    of, rows = Series(*series), []
    discs = Particles.of(alpha=0.0).under(of.law)
    packing: js.Packing | None = None
    phi_J = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotReachedWarning)  # rows tell
        for x in of.overlaps:
            u0 = x**discs.power / discs.power
            if packing is None:
                packing = js.make_packing(discs, n=of.n, seed=of.seed, u0=u0, progress=False)
                phi_J = float(packing.results["phi_J"])
            else:
                packing = js.minimise(packing, u0=u0, progress=False)
            rows.append({"overlap": x, "distance": packing.phi - phi_J, **_measured(packing)})
    return rows


def _measured(packing: js.Packing) -> dict[str, Any]:
    found: dict[str, Any] = {"reached": packing.reached, "pressure": packing.pressure}
    if not packing.reached:
        return found
    landscape, state = Landscape(packing), State.of(packing)
    matrix = dynamical_matrix(landscape, state)
    elastic = moduli(matrix, at=(landscape, state))
    return found | {
        "excess": _excess(matrix),
        "bulk": elastic.bulk.relaxed,
        "shear": elastic.B.G_dc.relaxed,
        "omega": float(np.sqrt(matrix.matrix.diagonal().mean())),
    }


def _excess(matrix: DynamicalMatrix) -> float:
    """Return z - z_iso without rattlers, from the least number of bonds that bears a pressure, 2 N - 1."""
    n = matrix.n_particles
    return 2 * (matrix.n_bonds - (2 * n - 1)) / n
