"""The bordered Hessian of every shape against differences of gradients and stresses, also in tilted boxes."""

import numpy as np
import pytest
from every_shape import MIXTURES, SIDES, TYPICAL, pressed, tilted

from jamshape.landscape import Landscape
from jamshape.packing import State
from jamshape.vibration.hessian import DynamicalMatrixOptions, dynamical_matrix, matrix_at
from jamshape.vibration.stability import BorderedMatrix
from jamshape.vibration.tensors import pressure_terms, strains_of

SCENES = [*((tilted, case) for case in TYPICAL), *((pressed, case) for case in MIXTURES)]
H = 1e-6


def bordered_of(packing):
    """Landscape, state and bordered matrix of any state."""
    landscape, state = Landscape(packing, 2.5, SIDES), State.of(packing)
    everyone = np.ones(packing.n, bool)
    options = DynamicalMatrixOptions(backbone=everyone, force=True)
    return landscape, state, BorderedMatrix.of(dynamical_matrix(landscape, state, options))


def slope(landscape, state, matrix, strain, motion):
    """Gradient by particles, and by the box at no outer pressure: the box deformed first, then particles moved."""
    D, strains = state.dimension, strains_of(state.dimension)
    shift, turn = matrix.coordinates.motion(motion)
    change = np.eye(D) + np.einsum("k,kab->ab", strain / matrix.length, strains)
    there = state.deformed(np.longdouble(change)).displaced(shift, turn)
    # Displacements after the strain are not strained themselves.
    net = landscape.components(landscape.evaluate(there).gradient)[:, :D]
    by_box = -(there.volume * landscape.stress(there) + net.T @ shift) @ np.linalg.inv(change).T
    own = np.einsum("kab,ab->k", strains, by_box) / matrix.length
    return np.append(matrix_at(landscape, there, matrix.coordinates).gradient, own)


@pytest.mark.parametrize(
    ("scene", "case"), SCENES, ids=[f"{scene.__name__}-{case}" for scene, case in SCENES]
)
def test_the_bordered_hessian_is_the_slope_of_gradients(scene, case):
    landscape, state, matrix = bordered_of(scene(case))
    found, d = matrix.matrix.toarray(), len(strains_of(state.dimension))
    terms = np.einsum("klab,ab->kl", pressure_terms(state.dimension).B, matrix.pressure_tensor)
    found[-d:, -d:] -= terms * matrix.volume / matrix.length**2  # at no outer pressure
    rng, scale = np.random.default_rng(1), np.abs(found).max()
    h = H * min(1.0, *landscape.rotation_length[landscape.rotation_length > 0])
    for kind in range(2):  # the box alone, and with a displacement; rotations do not commute
        motion = rng.uniform(-1, 1, matrix.coordinates.size) * ~matrix.coordinates.is_rotation
        strain = rng.uniform(-1, 1, d)
        direction = np.append(kind * motion, strain)
        ahead, behind = (
            slope(landscape, state, matrix, s * strain, s * kind * motion) for s in (h, -h)
        )
        difference = (ahead - behind) / (2 * h)
        assert np.abs(found @ direction - difference).max() < 1e-7 * scale * np.abs(direction).sum()
    np.testing.assert_array_equal(found, found.T)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_term_of_a_pressure_is_between_different_diagonal_strains(dimension):
    found = np.einsum("klab,ab->kl", pressure_terms(dimension).B, 0.3 * np.eye(dimension))
    expected = np.zeros_like(found)
    expected[:dimension, :dimension] = 0.3 * (1 - np.eye(dimension))
    np.testing.assert_allclose(found, expected, atol=1e-16)
