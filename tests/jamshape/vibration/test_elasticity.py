from dataclasses import replace

import numpy as np
import pytest
from lattices import discs
from small_packings import SMALL, jammed, matrix_of

from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import dynamical_matrix

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
    found = moduli(matrix_of(name))
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
