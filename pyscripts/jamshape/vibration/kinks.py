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
from jamshape.vibration.hessian import DynamicalMatrix, matrix_at

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
    """Give the matrix of motions that stay on kinks: across each is one more row of C, as stiff as the stiffest bond.

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
    radius = float(landscape.inner_radius.min())
    shift, turn = matrix.coordinates.motion(mode / np.abs(mode).max())
    clear = rounding_floor(landscape.evaluate(state), landscape) * matrix.bond_force
    jumps = []
    for way in (radius * distance for distance in _DISTANCES):
        ways = (way, -way)
        try:
            sides = [
                matrix_at(landscape, state.displaced(x * shift, x * turn), matrix) for x in ways
            ]
        except CrossingError:
            return None
        jumps.append(sides[0].gradient - sides[1].gradient)
        rises = min(mode @ sides[0].gradient, -(mode @ sides[1].gradient)) > clear
        # A bond more or less so near is a wall, which can be closed; further away it has nothing to do with the kink.
        is_wall = len(jumps) == 1 and any(side.n_bonds != matrix.n_bonds for side in sides)
        if is_wall or not rises:
            return None
    jump = jumps[0] - matrix.translations @ (matrix.translations.T @ jumps[0])
    return np.asarray(jump / np.linalg.norm(jump))
