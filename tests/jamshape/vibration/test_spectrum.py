from dataclasses import replace
from functools import partial

import mpmath
import numpy as np
import pytest
from small_packings import (
    DIGITS,
    SMALL,
    as_matrix,
    errors,
    exact_eigenvalues,
    jammed,
    matrix_of,
    second_order,
    sliding,
    synthetic,
)

from jamshape.vibration.extended import EPS, SparseRows, dense_product
from jamshape.vibration.hessian import DynamicalMatrixOptions, dynamical_matrix
from jamshape.vibration.quotients import grouped_error, isolated_error
from jamshape.vibration.sparse_modes import ShiftedInverse, lowest, near
from jamshape.vibration.spectrum import METHODS, spectrum, state_error

MATRICES = {"synthetic": synthetic, **{name: partial(matrix_of, name) for name in SMALL}}
MATRICES["at u = 1e-18"] = partial(matrix_of, "rods of alpha 4", 1e-18)
_EXACT = {}


@pytest.fixture(params=MATRICES)
def exact(request):
    """A matrix and its eigenvalues to 60 digits."""
    if request.param not in _EXACT:
        matrix = MATRICES[request.param]()
        _EXACT[request.param] = matrix, exact_eigenvalues(matrix)
    return _EXACT[request.param]


def assert_bounds_hold_and_are_not_loose(found, exact):
    """Below a millionth of the eigenvalue or what rounding of the entries does; or the error is large."""
    error = errors(found.eigenvalues, exact)
    assert (error <= found.solver_error).all()
    least = np.maximum(found.entry_error, 1e-6 * np.abs(found.eigenvalues))
    tight = found.solver_error <= np.maximum(1e4 * error, least)
    assert (tight | found.is_translation).all()


@pytest.mark.parametrize("method", ["projected", "refined"])
def test_every_eigenvalue_is_within_its_bound(exact, method, measured):
    matrix, values = exact
    found = spectrum(matrix, method)
    assert_bounds_hold_and_are_not_loose(found, values)
    size = np.maximum(np.abs(found.eigenvalues), second_order(matrix))
    relative = errors(found.eigenvalues, values) / size
    measured(error=relative[~found.is_translation].max())
    assert relative[~found.is_translation].max() < 1e-10
    signs = [int(mpmath.sign(value)) for value in values]
    sure = found.sign != 0
    assert sure[~found.is_translation].all()
    assert (found.sign == signs)[sure].all()


@pytest.mark.parametrize("method", ["plain", "first_order"])
def test_bounds_hold_where_eigenvalues_do_not(exact, method):
    matrix, values = exact
    found = spectrum(matrix, method)
    assert (errors(found.eigenvalues, values) <= found.solver_error).all()


def test_sliding_modes_are_noise_in_the_plain_spectrum_and_zero_in_first_order():
    matrix = synthetic()
    values = exact_eigenvalues(matrix)
    sliding = np.argsort([abs(float(v)) for v in values])[:2]
    assert all(abs(values[i]) < 1e-12 for i in sliding)
    of = {m: errors(spectrum(matrix, m).eigenvalues, values)[sliding] for m in METHODS}
    size = abs(float(values[sliding[0]]))
    assert (of["plain"] > 1e-5 * size).all()
    assert (of["first_order"] > 0.99 * size).all()
    assert (of["projected"] < 1e-11 * size).all()
    assert (of["refined"] < 1e-11 * size).all()


def test_a_long_tail_of_scales_keeps_its_digits():
    # Three levels: C, S = 1e-8, and S on the null space of S = 1e-16 of it.
    n = 24
    rng = np.random.default_rng(4)
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    C = (Q[:, :12] * np.geomspace(1, 3e-3, 12)).T
    S = 1e-8 * (Q[:, 12:20] * np.linspace(1, 2, 8)) @ Q[:, 12:20].T
    S += 1e-17 * (Q[:, 20:] * [1, -2, 3, -4]) @ Q[:, 20:].T
    matrix = as_matrix(C, 0.5 * (S + S.T))
    values = exact_eigenvalues(matrix)
    for method in ("projected", "refined"):
        found = spectrum(matrix, method)
        assert (errors(found.eigenvalues, values) <= found.solver_error).all()
        assert (found.solver_error < 1e-5 * np.abs(found.eigenvalues)).all()


def test_matrices_without_stiffness_or_without_prestress():
    rng = np.random.default_rng(5)
    S = rng.normal(size=(8, 8))
    matrix = as_matrix(np.zeros((1, 8)), S + S.T)
    expected = np.sort(-np.linalg.eigvalsh(S + S.T))
    np.testing.assert_allclose(spectrum(matrix).eigenvalues, expected, rtol=1e-13)
    C = rng.normal(size=(12, 8))
    matrix = as_matrix(C, np.zeros((8, 8)))
    expected = np.sort(np.linalg.svd(C)[1] ** 2)
    np.testing.assert_allclose(spectrum(matrix).eigenvalues, expected, rtol=1e-13)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SMALL)
def test_modes_are_orthonormal_and_all_there(name, method):
    matrix = matrix_of(name)
    found = spectrum(matrix, method)
    assert found.vectors.shape == (matrix.size, matrix.size)
    np.testing.assert_allclose(found.vectors.T @ found.vectors, np.eye(matrix.size), atol=1e-8)
    assert (np.diff(found.eigenvalues) >= 0).all()
    assert found.is_translation.sum() == 2
    if method != "plain":  # there they mix with sliding modes
        moves, T = found.vectors[:, found.is_translation], matrix.translations
        np.testing.assert_allclose(moves @ moves.T, T @ T.T, atol=1e-6)


@pytest.mark.parametrize("name", SMALL)
def test_translations_cost_nothing(name):
    found = spectrum(matrix_of(name))
    assert (np.abs(found.eigenvalues) <= found.bound)[found.is_translation].all()
    assert (found.sign[found.is_translation] == 0).all()


@pytest.mark.parametrize("name", SMALL)
def test_there_is_one_state_of_self_stress(name):
    matrix = matrix_of(name)
    assert spectrum(matrix).rank(matrix.residual.largest) == matrix.n_bonds - 1


def test_first_order_is_the_limit_of_small_prestress():
    matrix, differences = matrix_of("rods of alpha 0.01"), []
    for part in (1.0, 0.01):
        less = replace(matrix, prestress=part * matrix.prestress)
        ours, paper = (spectrum(less, method).eigenvalues for method in ("refined", "first_order"))
        low = slice(2, matrix.size - matrix.n_bonds + 1)
        differences.append(np.abs(paper / ours - 1)[low].max())
    assert differences[0] < 0.1
    assert differences[1] == pytest.approx(differences[0] / 100, rel=0.1)


def test_a_sliding_mode_is_the_slope_of_the_force_along_it():
    landscape, minimum, matrix = sliding()
    found = spectrum(matrix)
    softest = int(np.abs(found.eigenvalues + found.is_translation).argmin())
    value, mode = found.eigenvalues[softest], found.vectors[:, softest]
    assert abs(value) < 1e-12
    stiff = found.eigenvalues > 1e-6
    gradients = []
    for step in (1e-5, -1e-5):
        state = minimum.state.displaced(*matrix.coordinates.motion(step * mode))
        for _ in range(3):  # what is stiff follows
            gradient = dynamical_matrix(
                landscape, state, DynamicalMatrixOptions(force=True)
            ).gradient
            right = found.vectors[:, stiff].T @ gradient / found.eigenvalues[stiff]
            state = state.displaced(*matrix.coordinates.motion(-found.vectors[:, stiff] @ right))
        gradients.append(
            dynamical_matrix(landscape, state, DynamicalMatrixOptions(force=True)).gradient
        )
    slope = float(mode @ (gradients[0] - gradients[1])) / 2e-5
    assert slope == pytest.approx(value, rel=1e-3)


@pytest.mark.parametrize("name", SMALL)
def test_rotation_length_changes_neither_signs_nor_zeros(name):
    landscape, minimum = jammed(name)
    one, other = (
        spectrum(dynamical_matrix(landscape, minimum.state, DynamicalMatrixOptions(rotation=r)))
        for r in ("half_length", "radius")
    )
    assert sorted(one.sign) == sorted(other.sign)
    if name in {"discs", "rods of alpha 1"}:  # nothing turns, or A = R
        np.testing.assert_array_equal(one.eigenvalues, other.eigenvalues)
    else:
        assert np.abs(other.eigenvalues / one.eigenvalues - 1).max() > 0.1


def test_state_error_covers_the_way_to_the_minimum():
    landscape, minimum = jammed("rods of alpha 1")
    matrix = matrix_of("rods of alpha 1")
    best = spectrum(matrix)
    away = np.random.default_rng(2).normal(size=matrix.size)
    away -= matrix.translations @ (matrix.translations.T @ away)
    state = minimum.state.displaced(*matrix.coordinates.motion(1e-11 * away))
    shaken = dynamical_matrix(landscape, state, DynamicalMatrixOptions(force=True))
    found = spectrum(shaken)
    estimate = state_error(landscape, state, shaken, found)
    change = np.abs(found.eigenvalues - best.eigenvalues)
    real = ~found.is_translation
    assert change[real].max() > 1e3 * found.bound[real].max()
    assert (change[real] <= 1.1 * estimate[real] + found.bound[real] + best.bound[real]).all()
    assert (estimate[real] <= 1.1 * change[real] + found.bound[real] + best.bound[real]).all()


@pytest.mark.parametrize("name", SMALL)
def test_entry_error_covers_rounding_of_the_entries(name):
    matrix, eps = matrix_of(name), np.finfo(float).eps
    found = spectrum(matrix, "refined")
    rng = np.random.default_rng(8)
    largest = np.zeros(matrix.size)
    for _ in range(5):
        C, S = matrix.compatibility.copy(), matrix.prestress.tocoo()
        C.data *= 1 + 2 * eps * rng.uniform(-1, 1, C.nnz)
        factor = 1 + 2 * eps * rng.uniform(-1, 1, (matrix.size, matrix.size))
        factor = np.triu(factor) + np.triu(factor, 1).T
        S = S.toarray() * factor
        other = spectrum(as_matrix(C.toarray(), S, matrix.translations), "refined")
        real = ~found.is_translation
        change = np.abs(other.eigenvalues[~other.is_translation] - found.eigenvalues[real])
        solver = found.solver_error[real] + other.solver_error[~other.is_translation]
        assert (change <= found.entry_error[real] + solver).all()
        largest[real] = np.maximum(largest[real], change)
    assert (largest[real] > 1e-3 * found.entry_error[real]).mean() > 0.8  # and is not far above it


def test_unknown_methods_are_refused():
    with pytest.raises(ValueError, match="the method is 'exact', expected one of projected"):
        spectrum(matrix_of("discs"), "exact")


# --- bounds ------------------------------------------------------------------------------------


def test_bounds_are_those_of_kato_and_temple():
    values, residual = np.array([0.0, 1.0, 1.5]), np.array([0.1, 0.1, 0.3])
    expected = [0.1**2 / 0.9, 0.1**2 / 0.2, 0.3**2 / 0.4]
    np.testing.assert_allclose(isolated_error(values, residual), expected)
    # Where intervals overlap, there may be both eigenvalues in one of them.
    np.testing.assert_array_equal(
        isolated_error(np.array([0.0, 0.3]), np.array([0.2, 0.2])), [0.2, 0.2]
    )


def test_bounds_of_groups_hold():
    rng = np.random.default_rng(6)
    for size in (1e-3, 1e-5):
        A = np.diag([0, 1e-6, 2e-6, 0.1, 0.3, 1.0]) + size * 1e-2 * rng.normal(size=(6, 6))
        A = A + A.T
        values, pull = np.diag(A).copy(), np.abs(A - np.diag(np.diag(A)))
        bound = grouped_error(values, pull, np.empty(0))
        error = np.abs(np.sort(values) - np.linalg.eigvalsh(A))
        assert (error <= bound[np.argsort(values)]).all()
        assert bound[3:].max() < 10 * size**2


# --- sparse ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MATRICES)
def test_sparse_modes_are_those_of_the_whole_spectrum(name):
    matrix = MATRICES[name]()
    whole = spectrum(matrix)
    real = whole.eigenvalues[~whole.is_translation]
    expected = real[np.argsort(np.abs(real))[:9]]
    found = lowest(matrix, 9)
    assert found.n_before == -1
    rounding = 1e-11 * second_order(matrix)  # one may be 0 by chance
    np.testing.assert_allclose(found.eigenvalues, np.sort(expected), rtol=1e-9, atol=rounding)
    assert (np.abs(found.eigenvalues - np.sort(expected)) <= 2 * found.solver_error).all()
    size = np.maximum(np.abs(found.eigenvalues), second_order(matrix))
    assert (found.solver_error <= 1e-5 * size).all()
    shift = 0.5 * (real[-5] + real[-6])
    window = near(matrix, 4, shift)
    expected = real[np.argsort(np.abs(real - shift))[:4]]
    np.testing.assert_allclose(window.eigenvalues, np.sort(expected), rtol=1e-13)


def test_sparse_bounds_hold(exact):
    matrix, values = exact
    found = lowest(matrix, 9)
    doubles = np.array([float(v) for v in values])
    nearest = [int(np.abs(doubles - v).argmin()) for v in found.eigenvalues]
    assert len(set(nearest)) == 9
    error = errors(found.eigenvalues, [values[i] for i in nearest])
    assert (error <= found.solver_error).all()


def test_shifted_inverse_keeps_the_prestress():
    matrix = synthetic()
    b = np.random.default_rng(3).normal(size=matrix.size)
    v = ShiftedInverse(matrix, -1e-17).solve(b).v
    with mpmath.workdps(DIGITS):
        C = mpmath.matrix(matrix.compatibility.toarray().tolist())
        M = C.T * C - mpmath.matrix(matrix.prestress.toarray().tolist())
        for i in range(matrix.size):
            M[i, i] += mpmath.mpf(1e-17)
        expected = np.array([float(x) for x in mpmath.lu_solve(M, mpmath.matrix(b.tolist()))])
    np.testing.assert_allclose(v, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("k", [0, 1000])
def test_a_senseless_number_of_modes_is_refused(k):
    with pytest.raises(ValueError, match=f"{k} modes were requested, expected from 1 to"):
        lowest(matrix_of("discs"), k)


# --- extended precision ------------------------------------------------------------------------


def test_dense_products_have_the_digits_of_long_doubles():
    rng = np.random.default_rng(0)
    a = rng.normal(size=(20, 300)) * np.longdouble(10.0) ** rng.integers(-9, 9, size=(20, 1))
    a += a * np.longdouble(1e-17) * rng.normal(size=a.shape)
    b = rng.normal(size=(300, 15)).astype(np.longdouble) / 3
    scale = np.abs(a).max(axis=1)[:, None] * np.abs(b).max(axis=0)
    error = (dense_product(a, b) - a @ b) / scale
    assert np.abs(error).max() < 300 * EPS


def test_sparse_products_have_the_digits_of_long_doubles():
    matrix = matrix_of("rods of alpha 4")
    dense = np.random.default_rng(1).normal(size=(matrix.size, 300))
    product = SparseRows(matrix.compatibility) @ dense
    expected = matrix.compatibility.toarray().astype(np.longdouble) @ dense
    assert np.abs(product - expected).max() < 100 * EPS
    vector = SparseRows(matrix.compatibility) @ dense[:, 0]
    np.testing.assert_array_equal(vector, product[:, 0])
