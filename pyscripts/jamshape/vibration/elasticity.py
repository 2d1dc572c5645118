"""Elastic moduli of a packing from its dynamical matrix: affine strain, and how particles relax from it.

A strain e moves r_i - r_j of each contact by e (r_i - r_j), at fixed orientations, and then forces balance
again: with s the change of the bonds' lengths by the strain (times the roots of their stiffness) and f that
of the forces by the prestress, the motion x and the change y of the bonds' forces solve

    [ -S   C^T ] [ x ]   [ -f ]
    [  C   -1  ] [ y ] = [ -s ]

and the energy's second derivative is y.s + x.f + what the prestress does to the affine strain itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.vibration.hessian import DynamicalMatrix, Strains
from jamshape.vibration.sparse_modes import ShiftedInverse
from jamshape.vibration.spectrum import Spectrum


class Modulus(NamedTuple):
    """One elastic modulus, [energy / length^D]."""

    affine: float
    """Were particles to follow the strain."""
    relaxed: float
    """With forces balanced."""
    without_soft: float
    """The same with those modes held that were given as soft."""


class Moduli(NamedTuple):
    """Elastic moduli of a packing, each the second derivative of the energy over the volume."""

    bulk: Modulus
    """-V dp/dV."""
    pure_shear: Modulus
    """By gamma, x and y stretched by exp(gamma / 2) and exp(-gamma / 2)."""
    simple_shear: Modulus
    """By gamma, x moved by gamma y."""
    pressure: float
    """[energy / length^D], of the same state."""


def moduli(matrix: DynamicalMatrix, soft: Spectrum | None = None) -> Moduli:
    """Compute bulk and shear moduli.

    Parameters
    ----------
    matrix : DynamicalMatrix
        Of a minimum.
    soft : Spectrum, optional
        Modes to report the effect of. Sliding modes, which move far under any force, can lower moduli
        by much, or raise them where they are unstable; but in reality soon end at a new contact.

    Returns
    -------
    Moduli
    """
    D, V = matrix.coordinates.dimension, matrix.volume
    stretch, shear, tilt = np.eye(D), np.zeros((D, D)), np.zeros((D, D))
    shear[0, 0], shear[1, 1], tilt[0, 1] = 0.5, -0.5, 1.0
    strains = matrix.strained(np.stack([stretch, shear, tilt]))
    second = _second_derivatives(matrix, strains, soft)
    virial = matrix.contacts["separation"].T @ matrix.contacts["force"]
    pressure = float(np.trace(virial)) / (D * V)
    in_plane = float(virial[0, 0] + virial[1, 1]) / V

    def modulus(k: int, scale: float, add: float) -> Modulus:
        return Modulus(*(float(u / V * scale + add) for u in second[:, k]))

    return Moduli(
        bulk=modulus(0, 1 / D**2, (D - 1) / D * pressure),
        pure_shear=modulus(1, 1.0, -in_plane / 4),
        simple_shear=modulus(2, 1.0, 0.0),
        pressure=pressure,
    )


def _second_derivatives(
    matrix: DynamicalMatrix, strains: Strains, soft: Spectrum | None
) -> FloatArray:
    """(3, k): affine, relaxed, relaxed without soft modes."""
    s, f = strains.stretched, strains.pushed
    x, y = ShiftedInverse(matrix, 0.0).solve_both(-f, -s)
    affine = (s**2).sum(axis=0) + strains.affine
    relaxed = (y * s).sum(axis=0) + (x * f).sum(axis=0) + strains.affine
    held = relaxed
    if soft is not None and len(soft.eigenvalues):
        v = soft.vectors[:, ~soft.is_translation]
        along = (matrix.compatibility @ v).T @ s + v.T @ f
        held = relaxed + (along**2 / soft.eigenvalues[~soft.is_translation, None]).sum(axis=0)
    return np.stack([affine, relaxed, held])
