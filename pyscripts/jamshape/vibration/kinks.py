"""Kinks of the energy: where it is continuous, its slope jumps, and a minimum may lie.

The bond at the farther end of two nearly parallel rods is at the nearer one of two tips. Where both tips are level it
passes from one to the other: its overlap is the larger one of two, and its force turns by the angle between the rods. The
energy has a minimum there where its slopes rise on both sides, whatever the second derivatives of the sides are. General in
the shape: a kink is told by forces on both sides of it. Needs no LAMMPS.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse

from jamshape.arrays import FloatArray
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.minima import rounding_floor
from jamshape.vibration.hessian import DynamicalMatrix, gradient_in

# How far from a state the energy is to rise, over the smallest radius; the kink is nearer than the first.
_DISTANCES = (1e-8, 1e-7, 1e-6)


def kinks_across(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, modes: FloatArray
) -> FloatArray:
    """Find the kinks at a state along modes of negative eigenvalues.

    Where pieces are concave the energy falls on one side at least. If it rises on both, and bonds are the same where
    that begins, its slope jumps in between.

    Parameters
    ----------
    landscape, state
        What the matrix is of.
    matrix : DynamicalMatrix
    modes : (n, k) array of float64
        Unit columns.

    Returns
    -------
    (n, j) array of float64
        Unit normals of the kinks, of the j modes along which the energy rises on both sides.
    """
    normals = [_normal(landscape, state, matrix, mode) for mode in modes.T]
    found = [normal for normal in normals if normal is not None]
    return np.column_stack(found) if found else np.zeros((matrix.size, 0))


def held_at(matrix: DynamicalMatrix, normals: FloatArray) -> DynamicalMatrix:
    """Return the matrix of motions that stay on kinks: across each is one more row of C, as stiff as the stiffest bond.

    It is that of the pieces where the state is; others differ by what the forces change across a kink.
    """
    stiffest = float(matrix.bonds.stiffness.max())
    rows = scipy.sparse.csr_matrix(np.sqrt(stiffest) * normals.T)
    C = scipy.sparse.vstack([matrix.compatibility, rows]).tocsr()
    return replace(matrix, compatibility=C)


def _normal(
    landscape: Landscape, state: State, matrix: DynamicalMatrix, mode: FloatArray
) -> FloatArray | None:
    """Find the unit normal of the kink that a mode crosses, the way forces jump; None where there is none."""
    here = landscape.evaluate(state)
    clear = rounding_floor(here, landscape) * matrix.bond_force
    shift, turn = matrix.coordinates.motion(mode / np.abs(mode).max())

    def jump_at(distance: float, n_bonds: int | None = None) -> FloatArray | None:
        """How forces change from one side to the other; None where the energy does not rise to both."""
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
        # A bond more or less so near is a wall, which can be closed; further away it has nothing to do with the kink.
        jump = jump_at(nearest, here.n_bonds)
        if jump is None or any(jump_at(distance) is None for distance in others):
            return None
    except CrossingError:
        return None
    jump = jump - matrix.translations @ (matrix.translations.T @ jump)
    return np.asarray(jump / np.linalg.norm(jump))
