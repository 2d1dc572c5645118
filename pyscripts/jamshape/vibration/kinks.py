"""Kinks of the energy: it is continuous there, its slope jumps, and a minimum may lie on it.

The bond at the farther end of two nearly parallel rods is at the nearer one of two tips. Where both tips are level it
passes from one to the other: its overlap is the larger of two, and its force rotates by the angle between the rods. The
energy has a minimum there if its slopes rise on both sides, whatever the second derivatives on either side. Independent
of the shape: a kink is identified by forces on both sides of it. Needs no LAMMPS.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy  # loads its parts once they are used

from jamshape.arrays import FloatArray
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.minima import rounding_floor
from jamshape.vibration.hessian import DynamicalMatrix, gradient_in

# Distances at which the energy must rise, over the smallest radius; the kink is nearer than the first.
_DISTANCES = (1e-8, 1e-7, 1e-6)


def kinks_across(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, modes: FloatArray
) -> FloatArray:
    """Find the kinks at a state along modes of negative eigenvalues.

    On concave pieces the energy falls on at least one side. If it rises on both, and bonds are the same where
    that begins, its slope jumps in between.

    Parameters
    ----------
    landscape, state
        State of the matrix.
    matrix : DynamicalMatrix
    modes : (n, k) array of float64
        Unit columns.

    Returns
    -------
    (n, j) array of float64
        Unit normals of the kinks across the j modes along which the energy rises on both sides.
    """
    normals = [_normal(landscape, state, matrix, mode) for mode in modes.T]
    found = [normal for normal in normals if normal is not None]
    return np.column_stack(found) if found else np.zeros((matrix.size, 0))


def held_at(matrix: DynamicalMatrix, normals: FloatArray) -> DynamicalMatrix:
    """Return the matrix restricted to kinks: one more row of C across each, as stiff as the stiffest bond.

    It belongs to the piece of the state; others differ by the change of the forces across a kink.
    """
    stiffest = float(matrix.bonds.stiffness.max())
    rows = scipy.sparse.csr_matrix(np.sqrt(stiffest) * normals.T)
    C = scipy.sparse.vstack([matrix.compatibility, rows]).tocsr()
    return replace(matrix, compatibility=C)


def _normal(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, mode: FloatArray
) -> FloatArray | None:
    """Return the unit normal of the kink that a mode crosses, in direction of the force jump; None without one."""
    here = landscape.evaluate(state)
    clear = rounding_floor(here, landscape) * matrix.bond_force
    shift, turn = matrix.coordinates.motion(mode / np.abs(mode).max())

    def jump_at(distance: float, n_bonds: int | None = None) -> FloatArray | None:
        """Return the force jump between the sides; None unless the energy rises on both."""
        sides = []
        for x in (distance, -distance):
            there = landscape.evaluate(state.displaced(x * shift, x * turn))
            if n_bonds not in (None, there.n_bonds):
                return None
            sides.append(gradient_in(matrix.coordinates, landscape, there))
        rises = min(mode @ sides[0], -(mode @ sides[1])) > clear
        return sides[0] - sides[1] if rises else None

    nearest, *others = float(landscape.inner_radius.min()) * np.array(_DISTANCES)
    try:
        # A bond that opens or closes this near is a wall; farther away it is unrelated to the kink.
        jump = jump_at(nearest, here.n_bonds)
        if jump is None or any(jump_at(distance) is None for distance in others):
            return None
    except CrossingError:
        return None
    jump = jump - matrix.translations @ (matrix.translations.T @ jump)
    return np.asarray(jump / np.linalg.norm(jump))
