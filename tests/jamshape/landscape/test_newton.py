import numpy as np
import pytest
import scipy.sparse

from jamshape.landscape.newton import LEAST_SHIFT, Factorisation, Regularised


def random_symmetric(n, seed, density=0.1):
    rng = np.random.default_rng(seed)
    matrix = scipy.sparse.random(n, n, density, rng=rng, data_rvs=rng.standard_normal)
    diagonal = scipy.sparse.diags(rng.normal(size=n))
    return (matrix + matrix.T + diagonal).tocsc()


def smallest_eigenvalue(matrix):
    return np.linalg.eigvalsh(matrix.toarray()).min()


@pytest.mark.parametrize("n", [1, 2, 17, 120])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("shift", [0.0, 0.7, -1.3])
def test_negative_pivots_are_as_many_as_negative_eigenvalues(n, seed, shift):
    matrix = random_symmetric(n, seed)
    values = np.linalg.eigvalsh(matrix.toarray()) + shift
    assert np.abs(values).min() > 1e-6  # so that the sign is beyond doubt
    assert Factorisation.of(matrix, shift).n_negative == (values < 0).sum()


@pytest.mark.parametrize("seed", range(5))
def test_solution_solves(seed):
    rng = np.random.default_rng(seed)
    matrix = random_symmetric(80, seed)
    matrix = (matrix @ matrix.T + 1e-3 * scipy.sparse.identity(80)).tocsc()
    right = rng.normal(size=(80, 2))
    factors = Factorisation.of(matrix, 0.25)
    shifted = matrix.toarray() + 0.25 * np.eye(80)
    for b in (right, right[:, 0]):
        x = factors.solve(b)
        assert x.shape == b.shape
        assert np.abs(shifted @ x - b).max() < 1e-12 * np.abs(shifted).max() * np.abs(x).max()


@pytest.mark.parametrize("seed", range(5))
def test_indefinite_matrices_become_positive_definite(seed):
    matrix = random_symmetric(60, seed)
    least = smallest_eigenvalue(matrix)
    assert least < -0.5
    regularised = Regularised()
    factors = regularised.factorise(matrix)
    assert factors.n_negative == 0
    assert -least < regularised.shift < 10 * -least  # no more than the last power of ten
    b = np.random.default_rng(seed).normal(size=60)
    x = factors.solve(b)
    assert b @ x > 0
    residual = matrix @ x + regularised.shift * x - b
    assert np.abs(residual).max() < 1e-10 * np.abs(b).max()


@pytest.mark.parametrize(
    "matrix",
    [
        [[0.0, 1.0], [1.0, 0.0]],
        [[1.0, 1.0, 1.0], [1.0, 1.0, 2.0], [1.0, 2.0, 1.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0]],
    ],
)
def test_pivots_that_vanish_hide_no_negative_eigenvalue(matrix):
    matrix = scipy.sparse.csc_matrix(matrix)
    regularised = Regularised(shift=1e-12)
    regularised.factorise(matrix)
    assert regularised.shift > -smallest_eigenvalue(matrix)


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.diag([1.0, 0.0, 0.0])])
def test_singular_matrices_are_shifted(matrix):
    # Rattlers: rows of zeros.
    regularised = Regularised(shift=0.0)
    factors = regularised.factorise(scipy.sparse.csc_matrix(matrix))
    assert regularised.shift == pytest.approx(LEAST_SHIFT)
    assert np.isfinite(factors.solve(np.ones(3))).all()


def test_positive_definite_matrices_keep_their_shift():
    regularised = Regularised(shift=1e-9)
    regularised.factorise(scipy.sparse.identity(4, format="csc"))
    assert regularised.shift == 1e-9


def test_shift_falls_after_good_steps_and_rises_after_bad_ones():
    regularised = Regularised(shift=1e-3)
    regularised.learn(1)
    lower = regularised.shift
    assert lower < 1e-3
    regularised.learn(3)
    assert regularised.shift == lower
    regularised.learn(20)
    assert regularised.shift > 1e-3
