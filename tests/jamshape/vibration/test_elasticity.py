from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
import scipy.sparse
from lattices import discs
from scenes import make
from small_packings import DIGITS, SMALL, jammed, matrix_of

import jamshape as js
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import DynamicalMatrixOptions, dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.table import MODULI
from jamshape.vibration.tensors import pressure_terms, strains_of

U0 = 1e-8
H = 1e-9  # strain: 1e-5 of an overlap


def strained(state, change):
    """Particles and box moved by a linear map, an upper triangular matrix."""
    change = np.asarray(change, np.longdouble)
    return replace(state, position=state.position @ change.T, cell=change @ state.cell)


def relaxed(landscape, state):
    """Volume and virial after minimisation."""
    found = minimise(landscape, state, "newton", Stop(tolerance=1e-13, evaluations=2000))
    assert found.residual.largest < 1e-11
    derivatives = landscape.derivatives(found.state, extended=True)
    return found.state.volume, derivatives["separation"].T @ derivatives["force"]


def both_ways(landscape, state, change):
    return [relaxed(landscape, strained(state, change(np.longdouble(h)))) for h in (H, -H)]


@pytest.mark.parametrize("name", SMALL)
def test_moduli_are_those_of_finite_deformations(name):
    landscape, minimum = jammed(name, U0)
    found = moduli(matrix_of(name, U0))
    V = minimum.state.volume
    (V_up, up), (V_down, down) = both_ways(
        landscape, minimum.state, lambda e: np.diag([1 + e, 1 + e])
    )
    pressures = np.trace(up) / (2 * V_up), np.trace(down) / (2 * V_down)
    bulk = -V * (pressures[0] - pressures[1]) / (V_up - V_down)
    assert found.bulk.relaxed == pytest.approx(bulk, rel=1e-5)
    assert found.pressure == pytest.approx(sum(pressures) / 2, rel=1e-6)

    ways = both_ways(landscape, minimum.state, lambda g: np.diag(np.exp([g / 2, -g / 2])))
    slopes = [-0.5 * (virial[0, 0] - virial[1, 1]) for _, virial in ways]
    shear = (slopes[0] - slopes[1]) / (2 * H * V)
    assert found.pure_shear.relaxed == pytest.approx(shear, rel=1e-3, abs=1e-6 * bulk)

    ways = both_ways(landscape, minimum.state, lambda g: [[1, g], [0, 1]])
    slopes = [-virial[1, 0] for _, virial in ways]
    shear = (slopes[0] - slopes[1]) / (2 * H * V)
    assert found.simple_shear.relaxed == pytest.approx(shear, rel=1e-3, abs=1e-6 * bulk)


@pytest.mark.parametrize("name", SMALL)
def test_relaxation_softens(name):
    landscape, minimum = jammed(name)
    settled = minimise(landscape, minimum.state, "newton", Stop(tolerance=1e-13, evaluations=2000))
    found = moduli(dynamical_matrix(landscape, settled.state))
    for modulus in found[:3]:
        assert modulus.relaxed < modulus.affine
        assert modulus.reason == ""


def test_a_square_crystal_of_discs_has_its_moduli():
    n, overlap = 4, 1e-6
    a = 1 - overlap
    x, y = np.meshgrid(np.arange(n) + 0.5, np.arange(n) + 0.5)
    packing = discs(a * np.column_stack([x.ravel(), y.ravel()]), (n * a, n * a))
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    found = moduli(matrix)
    # Per particle two bonds of energy (1 - r)^2 / 2, one along each axis.
    pressure = overlap / a
    assert found.pressure == pytest.approx(pressure, rel=1e-9)
    assert found.bulk.relaxed == pytest.approx(0.5 + 0.5 * pressure, rel=1e-8)
    assert found.pure_shear.relaxed == pytest.approx(0.5 - 0.5 * pressure, rel=1e-8)
    assert found.simple_shear.relaxed == pytest.approx(-pressure, rel=1e-6)


# --- floppy modes and bounds ----------------------------------------------------------------------


@cache
def floppy():
    """A packing of rods some of which slide freely: landscape, state, matrix and spectrum."""
    for seed in range(6, 30):
        packing = js.make_packing(
            js.Spherocylinders(alpha=4), n=8, u0=1e-6, seed=seed, progress=False
        )
        landscape, state = Landscape(packing), State.of(packing)
        matrix = dynamical_matrix(landscape, state, DynamicalMatrixOptions(force=True))
        whole = spectrum(matrix)
        if whole.is_floppy.any() and matrix.residual.largest < 1e-8:
            return landscape, state, matrix, whole
    raise AssertionError


def coupling_of(matrix):
    """Simple shear: change of the forces at fixed positions, and the energy's second derivative."""
    given = matrix.strained(np.array([[[0.0, 1.0], [0.0, 0.0]]]))
    pushed = matrix.compatibility.T @ given.stretched[:, 0] + given.pushed[:, 0]
    return pushed, float((given.stretched**2).sum() + given.affine[0, 0])


def test_floppy_modes_are_left_out():
    landscape, state, matrix, whole = floppy()
    found = moduli(matrix, whole, (landscape, state))
    assert found.n_floppy == whole.is_floppy.sum() > 0
    assert [m.reason for m in found[:3]] == [""] * 3
    pushed, affine = coupling_of(matrix)
    values, vectors = np.linalg.eigh(matrix.matrix.toarray())
    stiff = np.argsort(np.abs(values))[found.n_floppy + matrix.translations.shape[1] :]
    left = affine - ((vectors[:, stiff].T @ pushed) ** 2 / values[stiff]).sum()
    assert found.simple_shear.relaxed == pytest.approx(left / matrix.volume, rel=1e-9)
    ways = both_ways(landscape, state, lambda g: [[1, g], [0, 1]])
    slopes = [-virial[1, 0] for _, virial in ways]
    shear = (slopes[0] - slopes[1]) / (2 * H * matrix.volume)
    assert found.simple_shear.relaxed == pytest.approx(shear, rel=1e-4)
    sparse = moduli(matrix, None, (landscape, state))
    for name in MODULI:
        own, other = getattr(found, name), getattr(sparse, name)
        assert abs(own.relaxed - other.relaxed) <= own.rounding + other.rounding
        assert own.bound < 1e-6 * abs(own.relaxed)


def test_a_floppy_mode_that_couples_leaves_no_modulus():
    _, _, matrix, whole = floppy()
    pushed, _ = coupling_of(matrix)
    firm = np.flatnonzero(whole.is_firm)
    k = firm[np.abs(whole.vectors[:, firm].T @ pushed).argmax()]  # made floppy
    v = whole.vectors[:, k]
    S = matrix.prestress.toarray() + whole.eigenvalues[k] * np.outer(v, v)
    cut = replace(matrix, prestress=scipy.sparse.csr_matrix(0.5 * (S + S.T)))
    modes = spectrum(cut)
    assert modes.is_floppy.sum() == whole.is_floppy.sum() + 1
    found = moduli(cut, modes)
    assert np.isnan(found.simple_shear.relaxed)
    assert "to this strain (by " in found.simple_shear.reason
    assert "so nothing resists it" in found.simple_shear.reason
    assert found.simple_shear.affine == pytest.approx(moduli(matrix, whole).simple_shear.affine)
    assert np.isnan(found.B["xyxy"].relaxed)
    assert found.B["xyxy"].reason == found.simple_shear.reason
    assert np.isnan(found.B.relaxed[:, 2]).all()
    assert found.is_stable_to_shear is False  # a box that deforms along it meets no resistance


@pytest.mark.parametrize("name", ["rods of alpha 1", "rods of alpha 4", "floppy"])
def test_rounding_is_bounded(name):
    """Against the stored matrix and strain in many digits, in the space beside floppy modes."""
    matrix = floppy()[2] if name == "floppy" else matrix_of(name, U0)
    whole = spectrum(matrix)
    found = moduli(matrix, whole)
    given = matrix.strained(np.array([[[0.0, 1.0], [0.0, 0.0]]]))
    held = np.column_stack([matrix.translations, whole.vectors[:, whole.is_floppy]])
    with mpmath.workdps(DIGITS):
        C, S = (
            mpmath.matrix(part.toarray().tolist())
            for part in (matrix.compatibility, matrix.prestress)
        )
        s, f, Z = (mpmath.matrix(part.tolist()) for part in (given.stretched, given.pushed, held))
        push = C.T * s + f
        beside = C.T * C - S + Z * Z.T  # which does not move what is held
        x = mpmath.lu_solve(beside, -push + Z * (Z.T * push))
        exact = (s.T * s)[0] + mpmath.mpf(float(given.affine[0, 0])) + (x.T * push)[0]
        error = float(abs(exact / mpmath.mpf(matrix.volume) - found.simple_shear.relaxed))
    assert error <= found.simple_shear.rounding + 1e-16 * abs(found.simple_shear.relaxed)


@pytest.mark.parametrize("name", ["rods of alpha 1", "rods of alpha 4"])
def test_rounding_of_tensors_is_bounded(name):
    matrix = matrix_of(name, U0)
    tensor, given = moduli(matrix).B, matrix.strained(strains_of(2))
    with mpmath.workdps(DIGITS):
        C, S = (
            mpmath.matrix(part.toarray().tolist())
            for part in (matrix.compatibility, matrix.prestress)
        )
        s, f, Z = (
            mpmath.matrix(part.tolist())
            for part in (given.stretched, given.pushed, matrix.translations)
        )
        push = C.T * s + f
        factors, order = mpmath.mp.LU_decomp(C.T * C - S + Z * Z.T)
        columns = [
            mpmath.mp.U_solve(factors, mpmath.mp.L_solve(factors, -push[:, k], order))
            for k in range(3)
        ]
        rise = s.T * s + mpmath.matrix([[(push[:, k].T * x)[0] for x in columns] for k in range(3)])
        virial = matrix.contacts["separation"].T @ matrix.contacts["force"]
        virial = 0.5 * (virial + virial.T)  # what is left of torques is not part of a pressure
        weights = pressure_terms(2).B
        for k, m in np.ndindex(3, 3):
            exact = (rise[k, m] + float(given.affine[k, m]) + (weights[k, m] * virial).sum()) / (
                mpmath.mpf(matrix.volume)
            )
            error = float(abs(exact - tensor.relaxed[k, m]))
            assert error <= tensor.rounding[k, m] + 1e-16 * abs(tensor.relaxed[k, m])


# The change of one entry may nearly cancel in first order, which its bound is made of: up to 3 times the bound
# was found, in one of eight packings.
CANCELS = pytest.mark.xfail(reason="the change of an entry cancels in first order", strict=False)


@pytest.mark.parametrize("name", ["discs", pytest.param("rods of alpha 4", marks=CANCELS)])
def test_what_a_residual_changes_is_bounded(name):
    landscape, minimum = jammed(name, U0)
    exact = moduli(matrix_of(name, U0))
    scale = 1e-7 * matrix_of(name, U0).bond_force
    noise = scale * np.random.default_rng(0).normal(size=landscape.size)
    moved = landscape.displaced(minimum.state, noise)
    matrix = dynamical_matrix(landscape, moved)
    assert matrix.residual.largest > 1e-8
    found = moduli(matrix, None, (landscape, moved))
    for own, other in zip(found[:3], exact[:3], strict=True):
        change = abs(own.relaxed - other.relaxed)
        assert 1e-12 * abs(other.relaxed) < change <= own.bound < 1e-3 * abs(other.relaxed)
    for tensor in ("B", "C"):
        own, other = getattr(found, tensor), getattr(exact, tensor)
        assert (np.abs(own.relaxed - other.relaxed) <= own.bound).all()
        assert own.bound.max() < 1e-3 * np.abs(other.relaxed).max()


def test_a_state_that_is_no_minimum_has_no_moduli():
    landscape, minimum = jammed("rods of alpha 1", U0)
    noise = np.random.default_rng(0).normal(size=landscape.size)
    moved = landscape.displaced(minimum.state, 1e-5 * noise)
    found = moduli(
        dynamical_matrix(landscape, moved, DynamicalMatrixOptions(force=True)),
        None,
        (landscape, moved),
    )
    for modulus in found[:3]:
        assert np.isnan(modulus.relaxed)
        assert "the state is not at a minimum: its largest net force is" in modulus.reason


def test_rows_of_rods_slide_freely():
    """Flat on each other: nothing holds them along x, and 16 bonds along y."""
    length, h = 3.01, 1 - 1e-6
    position = [[i * length + j * length / 2, j * h] for j in range(2) for i in range(2)]
    packing = make(position, 0.0, half_length=1.0, edges=(2 * length, 2 * h))
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    found = moduli(matrix)
    assert found.n_floppy >= 1
    volume, pressure = 4 * length * h, 16 * (1 - h) * h / (2 * 4 * length * h)
    assert found.pressure == pytest.approx(pressure, rel=1e-9)
    assert found.bulk.relaxed == pytest.approx(16 * h**2 / volume / 4 + pressure / 2, rel=1e-6)
    assert abs(found.simple_shear.relaxed) <= found.simple_shear.rounding + 1e-9
