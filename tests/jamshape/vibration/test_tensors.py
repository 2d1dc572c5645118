"""Elastic tensors and stability to shear: closed forms, finite deformations, rotation, and averages."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from lattices import discs
from small_packings import jammed
from test_elasticity import floppy

import jamshape as js
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.packing.box import COMPONENTS
from jamshape.vibration import stability
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.stability import BorderedMatrix, softest_of, stability_of
from jamshape.vibration.tensors import ElasticTensor, strains_of

# --- crystals --------------------------------------------------------------------------------------


def hexagonal(overlap, n=4):
    a = 1 - overlap
    x, y = np.meshgrid(np.arange(n) + 0.25, np.arange(n) + 0.25)
    x = x + 0.5 * (np.arange(n)[:, None] % 2)
    position = a * np.column_stack([x.ravel(), math.sqrt(0.75) * y.ravel()])
    return discs(position, a * n * np.array([1, math.sqrt(0.75)]))


def fcc(overlap, n=2):
    edge = math.sqrt(2) * (1 - overlap)
    corners = np.array(list(np.ndindex(n, n, n)), float)
    basis = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / 2
    position = edge * (0.1 + (corners[:, None] + basis).reshape(-1, 3))
    return js.Packing.of("spherocylinder", position, box=[n * edge] * 3, alpha=0)


class Crystal:
    """Bonds of energy (1 - r)^2 / 2 between neighbours at the distance a: C from sums over their directions n."""

    def __init__(self, overlap, dimension):
        a, D = 1 - overlap, dimension
        directions, volume = {
            2: ([[1, 0], [0.5, math.sqrt(0.75)], [-0.5, math.sqrt(0.75)]], math.sqrt(0.75)),
            3: (
                [[1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1]],
                math.sqrt(0.5),
            ),
        }[D]
        n = np.array(directions) / np.linalg.norm(directions, axis=1)[:, None]
        v, (i, j) = volume * a**D, np.array([["xyz".index(x) for x in c] for c in COMPONENTS[D]]).T
        self.pressure = len(n) * a * overlap / (D * v)
        pairs = n[:, i] * n[:, j]
        # Stiffness 1 along the bond, and tension over length -overlap / a across it.
        self.C = (1 + overlap / a) * a**2 / v * pairs.T @ pairs
        unit = np.eye(D)
        of_pressure = unit[i][:, i] * unit[j][:, j] + unit[i][:, j] * unit[j][:, i]
        of_pressure -= unit[i, j][:, None] * unit[i, j]
        self.B = self.C - self.pressure * of_pressure


@pytest.mark.parametrize("overlap", [0.05, 1e-4])
@pytest.mark.parametrize(("crystal", "dimension"), [(hexagonal, 2), (fcc, 3)])
def test_crystals_have_their_tensors(crystal, dimension, overlap):
    packing, known = crystal(overlap), Crystal(overlap, dimension)
    landscape, state = Landscape(packing), State.of(packing)
    found = moduli(dynamical_matrix(landscape, state), None, (landscape, state))
    assert found.is_stable_to_shear is True
    assert found.bordered.sign == 1
    accuracy = {"rtol": 0, "atol": 1e-10 * np.abs(known.C).max()}
    assert found.pressure == pytest.approx(known.pressure, rel=1e-10)
    for name in ("B", "C"):
        tensor = getattr(found, name)
        np.testing.assert_allclose(tensor.relaxed, getattr(known, name), **accuracy)
        np.testing.assert_allclose(tensor.affine, getattr(known, name), **accuracy)
    np.testing.assert_array_equal(found.B.relaxed, found.B.relaxed.T)
    assert np.abs(known.B - known.C).max() > 0.1 * known.pressure
    if dimension == 2:  # isotropic
        shear = known.B[2, 2]
        for name in ("G_dc", "G_min", "G_max"):
            assert getattr(found.B, name).relaxed == pytest.approx(shear, rel=1e-9)
        assert found.B.G_ac.relaxed < 1e-10
    else:  # cubic: two shear moduli, of multiplicity 2 and 3
        soft, stiff = 0.5 * (known.B[0, 0] - known.B[0, 1]), known.B[3, 3]
        assert found.B.G_min.relaxed == pytest.approx(soft, rel=1e-9)
        assert found.B.G_max.relaxed == pytest.approx(stiff, rel=1e-9)
        assert found.B.G_dc.relaxed == pytest.approx((2 * soft + 3 * stiff) / 5, rel=1e-9)


@pytest.mark.parametrize(("crystal", "dimension"), [(hexagonal, 2), (fcc, 3)])
def test_b_is_of_the_enthalpy_and_c_of_the_energy(crystal, dimension):
    """Second differences by a symmetric strain e, of U + p V with F = 1 + e, and of U with F^T F = 1 + 2 e."""
    packing, h = crystal(0.05), 1e-4
    landscape, state, known = Landscape(packing), State.of(packing), Crystal(0.05, dimension)
    strain = np.random.default_rng(1).uniform(-1, 1, (dimension, dimension))
    strain = 0.5 * (strain + strain.T)
    vector = np.array(
        [(1 + (a != b)) * strain["xyz".index(a), "xyz".index(b)] for a, b in COMPONENTS[dimension]]
    )

    def second(value):
        up, here, down = (value(s) for s in (h, 0.0, -h))
        return (up - 2 * here + down) / (h**2 * state.volume)

    def energy(square, pressure):  # upper triangular F of a given F^T F
        change = np.linalg.cholesky(square).T
        there = state.deformed(np.asarray(change, np.longdouble))
        return landscape.evaluate(there).energy + pressure * there.volume

    one = np.eye(dimension)
    enthalpy = second(lambda s: energy((one + s * strain) @ (one + s * strain), known.pressure))
    by_green = second(lambda s: energy(one + 2 * s * strain, 0.0))
    assert enthalpy == pytest.approx(vector @ known.B @ vector, rel=1e-5)
    assert by_green == pytest.approx(vector @ known.C @ vector, rel=1e-5)
    assert enthalpy != pytest.approx(by_green, rel=1e-2)


# --- packings -------------------------------------------------------------------------------------

MADE = {
    "superellipsoids": (js.Superellipsoids(p=1.3, w1=0.8, size_ratio=1.4), 2),
    "spheres": (js.Spherocylinders(alpha=0), 3),
    "rods in space": (js.Spherocylinders(alpha=1), 3),
    "superellipsoids in space": (js.Superellipsoids(p=1.3, w1=0.8), 3),
}
JAMMED = ("discs", "rods of alpha 1", "rods of alpha 4")
ALL = [*JAMMED, *MADE]


@cache
def packed(name):
    """Landscape and state of a packing of few particles."""
    if name in JAMMED:
        landscape, minimum = jammed(name, 1e-6)
        return landscape, minimum.state
    particles, dimension = MADE[name]
    packing = js.make_packing(
        particles, n=8, u0=1e-6, seed=2, dimension=dimension, tolerance=1e-12, progress=False
    )
    return Landscape(packing), State.of(packing)


@cache
def moduli_of(name):
    landscape, state = packed(name)
    return moduli(dynamical_matrix(landscape, state), None, (landscape, state))


def relaxed(landscape, state):
    found = minimise(landscape, state, "newton", Stop(tolerance=1e-12, evaluations=2000))
    assert found.residual.largest < 1e-10
    return found.state


def stress(landscape, state, strain):
    """Pressure tensor after a symmetric strain 1 + e, in axes that do not rotate."""
    rotation, change = np.linalg.qr(np.eye(state.dimension) + strain)
    signs = np.sign(np.diagonal(change))
    rotation, change = rotation * signs, signs[:, None] * change
    there = relaxed(landscape, state.deformed(np.asarray(change, np.longdouble)))
    return rotation @ landscape.stress(there) @ rotation.T


@pytest.mark.parametrize("name", ALL)
def test_b_is_the_change_of_the_stress(name, measured):
    """After every strain, relaxed, up and down; of any pressure tensor the symmetric part."""
    landscape, state = packed(name)
    found, h, strains = moduli_of(name).B, 1e-7, strains_of(state.dimension)
    rows = []
    for strain in strains:
        e = 0.5 * h * (strain + strain.T)
        change = stress(landscape, state, e) - stress(landscape, state, -e)
        rows.append([-(change * s).sum() / (2 * h) for s in strains])
    by_stress = 0.5 * (np.array(rows) + np.array(rows).T)
    off = np.abs(found.relaxed - by_stress).max() / np.abs(found.relaxed).max()
    measured(off=off)
    assert off < 1e-4
    pressure = moduli_of(name).pressure
    deviator = landscape.stress(state) - pressure * np.eye(state.dimension)
    assert np.abs(deviator).max() > 1e-3 * pressure  # which is why there is a symmetric part


@pytest.mark.parametrize("name", ["discs", "superellipsoids in space"])
def test_moduli_are_read_off_one_tensor(name):
    found = moduli_of(name)
    landscape, state = packed(name)
    P, D = landscape.stress(state), state.dimension
    dilation = found.B.relaxed[:D, :D].sum() / D**2
    assert found.bulk.relaxed == pytest.approx(dilation, rel=1e-8)
    simple = found.B["xyxy"].relaxed + 0.5 * (P[0, 0] - P[1, 1])
    assert found.simple_shear.relaxed == pytest.approx(simple, abs=1e-10)
    pure = (
        0.25 * (found.B["xxxx"].relaxed + found.B["yyyy"].relaxed) - 0.5 * found.B["xxyy"].relaxed
    )
    assert found.pure_shear.relaxed == pytest.approx(pure, abs=1e-10)


def test_turned_packings_have_turned_tensors():
    """By 90 degrees: x to y, y to -x. Affine values at fixed orientations depend on which axis the box keeps."""
    landscape, state = packed("rods of alpha 4")
    turn = np.array([[0, -1], [1, 0]])
    cell = np.diag(state.edges[::-1])
    other = State(state.position @ turn.T, state.orientation + np.pi / 2, cell)
    found, turned = moduli_of("rods of alpha 4"), moduli(dynamical_matrix(landscape, other))
    order, sign = [1, 0, 2], np.array([1, 1, -1])
    for name in ("B", "C"):
        own = sign[:, None] * sign * getattr(found, name).relaxed[np.ix_(order, order)]
        scale = 1e-8 * np.abs(own).max()
        np.testing.assert_allclose(getattr(turned, name).relaxed, own, rtol=0, atol=scale)
    for name in ("G_dc", "G_min", "G_max", "G_ac", "smallest"):
        one, two = (getattr(m.B, name).relaxed for m in (found, turned))
        assert one == pytest.approx(two, abs=1e-8)


@pytest.mark.parametrize("d", [3, 6])
def test_averages_are_those_over_directions(d):
    """Of a random tensor, by quadrature: over angles in 2D, over random orientations in space."""
    rng, D = np.random.default_rng(d), {3: 2, 6: 3}[d]
    entries = rng.normal(size=(d, d))
    entries = entries + entries.T
    found = ElasticTensor(entries, entries, 0 * entries, 0 * entries, ("",) * d)
    if D == 2:
        angle = np.linspace(0, np.pi, 720, endpoint=False)
        n = np.column_stack([np.cos(angle), np.sin(angle)])
        m = np.column_stack([-np.sin(angle), np.cos(angle)])
    else:
        n, m, _ = np.linalg.qr(rng.normal(size=(400000, 3, 3)))[0].transpose(2, 0, 1)
    e = n[:, :, None] * m[:, None, :]
    e = e + e.transpose(0, 2, 1)
    i, j = np.array([["xyz".index(x) for x in c] for c in COMPONENTS[D]]).T
    strain = np.where(i == j, 0.5, 1.0) * e[:, i, j]
    shear = np.einsum("sk,kl,sl->s", strain, entries, strain)
    accuracy = {2: 1e-12, 3: 0.02}[D]
    assert found.G_dc.relaxed == pytest.approx(shear.mean(), abs=accuracy)
    assert found.G_min.relaxed <= shear.min() + 1e-12
    assert shear.max() <= found.G_max.relaxed + 1e-12
    if D == 2:
        assert found.G_ac.relaxed == pytest.approx(shear.std(), rel=1e-12)
        assert found.G_min.relaxed == pytest.approx(shear.min(), rel=1e-4)
        assert found.G_max.relaxed == pytest.approx(shear.max(), rel=1e-4)


def test_bounds_of_averages_hold():
    rng = np.random.default_rng(0)
    for d in (3, 6):
        entries = rng.normal(size=(d, d))
        entries, off = entries + entries.T, 1e-3 * rng.uniform(size=(d, d))
        off = off + off.T
        found = ElasticTensor(entries, entries, off, 0 * off, ("",) * d)
        for _ in range(200):
            change = np.triu(rng.choice([-1, 1], (d, d)))
            change = off * (change + np.triu(change, 1).T)
            other = replace(found, relaxed=entries + change)
            for name in ("smallest", "G_dc", "G_min", "G_max", "G_ac"):
                one, two = getattr(found, name), getattr(other, name)
                assert abs(one.relaxed - two.relaxed) <= one.bound


# --- stability ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ALL)
def test_negative_eigenvalues_are_those_of_the_parts(name):
    """As many of the bordered Hessian as of M and of B (Haynsworth)."""
    landscape, state = packed(name)
    matrix = dynamical_matrix(landscape, state)
    whole, tensor = spectrum(BorderedMatrix.of(matrix)), moduli_of(name).B.relaxed
    expected = (spectrum(matrix).sign < 0).sum() + (np.linalg.eigvalsh(tensor) < 0).sum()
    assert (whole.sign < 0).sum() == expected
    assert moduli_of(name).is_stable_to_shear is bool(expected == 0)


@pytest.mark.parametrize("name", ALL)
def test_few_modes_have_the_smallest_eigenvalue(name, monkeypatch):
    landscape, state = packed(name)
    matrix = BorderedMatrix.of(dynamical_matrix(landscape, state))
    some = softest_of(matrix)
    monkeypatch.setattr(stability, "_DENSE", matrix.size)
    whole = softest_of(matrix)
    bound = some.eigenvalue.bound + whole.eigenvalue.bound
    assert abs(some.eigenvalue.value - whole.eigenvalue.value) <= bound
    assert abs(some.vector @ whole.vector) == pytest.approx(1, abs=1e-6)


@cache
def unstable():
    """Discs at a minimum in a fixed box that are unstable to shear: landscape, state and moduli."""
    for seed in range(1, 40):
        packing = js.make_packing(
            js.Spherocylinders(alpha=0), n=16, u0=1e-6, seed=seed, tolerance=1e-12, progress=False
        )
        landscape, state = Landscape(packing), State.of(packing)
        found = moduli(dynamical_matrix(landscape, state), None, (landscape, state))
        if found.is_stable_to_shear is False:
            return landscape, state, found
    raise AssertionError


def test_the_enthalpy_decreases_along_the_direction():
    landscape, state, found = unstable()
    assert found.n_negative == 0
    assert found.bordered.sign == -1
    direction = stability_of(landscape, state)
    assert direction.sign == -1
    assert direction.eigenvalue == found.bordered
    assert direction.motion.shape == (landscape.size,)
    np.testing.assert_array_equal(direction.strain, np.triu(direction.strain))
    pressure, change = found.pressure, np.eye(2, dtype=np.longdouble)

    def enthalpy(t):
        moved = landscape.displaced(state, t * direction.motion)
        there = moved.deformed(change + t * direction.strain)
        return landscape.evaluate(there).energy + pressure * there.volume

    h, here = 1e-5, enthalpy(0.0)
    second = (enthalpy(h) - 2 * here + enthalpy(-h)) / h**2
    assert second < 0
    # The pressure tensor differs from p 1, by which the box's block does.
    deviator = np.abs(landscape.stress(state) - pressure * np.eye(2)).max()
    off = 2 * state.volume * deviator * (direction.strain**2).sum()
    assert second == pytest.approx(direction.eigenvalue.value, abs=1.1 * off)


def test_verdicts_need_their_bounds():
    _, _, found = unstable()
    B = found.B
    assert found._replace(bordered=found.bordered._replace(value=1.0)).is_stable_to_shear is False
    wide = replace(B, of_state=np.full_like(B.of_state, np.inf))
    assert found._replace(B=wide).is_stable_to_shear is False
    open_ = found._replace(B=wide, bordered=found.bordered._replace(bound=1.0))
    assert open_.is_stable_to_shear is None
    stable = replace(B, relaxed=B.relaxed + np.eye(3))
    assert found._replace(B=stable, bordered=open_.bordered).is_stable_to_shear is True


def test_floppy_modes_leave_tensors():
    landscape, state, matrix, whole = floppy()
    found = moduli(matrix, whole, (landscape, state))
    assert found.n_floppy > 0
    assert np.isfinite(found.B.relaxed).all()
    assert not any(found.B.reasons)


def test_states_at_no_minimum_have_no_tensors():
    landscape, state = packed("rods of alpha 1")
    noise = np.random.default_rng(0).normal(size=landscape.size)
    packing = landscape.displaced(state, 1e-5 * noise).packing(landscape.particles)
    found = js.modes(packing, force=True).moduli
    assert found.is_stable_to_shear is None
    assert np.isnan(found.B.relaxed).all()
    assert "the state is not at a minimum" in found.B["xyxy"].reason
    assert math.isnan(found.B.G_dc.relaxed)
    assert "the state is not at a minimum" in found.B.G_dc.reason


def test_entries_have_names():
    tensor = moduli_of("discs").B
    assert tensor["xxxy"].relaxed == tensor.relaxed[0, 2]
    assert tensor.components == ("xx", "yy", "xy")
    with pytest.raises(ValueError, match="expected one of xxxx, xxyy, xxxy, yyxx"):
        tensor["xyx"]
