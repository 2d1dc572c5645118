"""Motions that contacts block to second order, beside second differences of gaps in closed form, and counts of packings."""

import numpy as np
import pytest
from scipy.linalg import null_space

import jamshape as js
from common.constraints import blocked_motions, constraints_of
from common.mode_tables import modes_of
from jamshape.landscape import Landscape, State
from jamshape.vibration.hessian import DynamicalMatrixOptions, dynamical_matrix


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def disc_gap(r, *_):
    """Of discs of diameter 1."""
    return np.hypot(*r) - 1


def tip_gap(r, turn_i, turn_j):
    """Of a rod that points along y, its lower tip on a rod along x; radius 1/2, half length of spines 1."""
    normal = unit(turn_j + np.pi / 2)
    return normal @ (r - unit(np.pi / 2 + turn_i)) - 1


def tips_gap(r, turn_i, turn_j):
    """Of two such rods in a row along x, tip to tip."""
    return np.linalg.norm(r - unit(turn_i) - unit(turn_j)) - 1


GAPS = {
    "discs": (disc_gap, 0.0, [0.0, 0.999], [0.0, 0.0]),
    "tip on a side": (tip_gap, 2.0, [0.2, 1.999], [np.pi / 2, 0.0]),
    "tip to tip": (tips_gap, 2.0, [2.999, 0.0], [0.0, 0.0]),
}


def closing_motions(gap, r):
    """How many motions along the surface gap = constant close the gap, by central differences."""
    at, h = np.array([*r, 0.0, 0.0]), 1e-4
    of = lambda x: gap(x[:2], x[2], x[3])
    e = h * np.eye(4)
    gradient = np.array([of(at + k) - of(at - k) for k in e]) / (2 * h)
    second = np.array([[of(at + a + b) - of(at + a - b) - of(at - a + b) + of(at - a - b)
                        for b in e] for a in e]) / (4 * h * h)  # fmt: skip
    along = null_space(gradient[None])
    return int((np.linalg.eigvalsh(along.T @ second @ along) < -1e-4).sum())


@pytest.mark.parametrize(("gap", "alpha", "r", "angles"), GAPS.values(), ids=GAPS)
def test_blocked_motions_are_those_that_close_a_gap(gap, alpha, r, angles):
    place = [np.add([6, 6], r), [6, 6]]
    pair = js.Packing.of("spherocylinder", place, angles, box=[12.0, 12.0], alpha=alpha)
    landscape = Landscape(pair)
    every = DynamicalMatrixOptions(backbone=np.array([True, True]), force=True)
    matrix = dynamical_matrix(landscape, State.of(pair), every)
    (found,) = blocked_motions(matrix, landscape.rotation_length)
    assert found == closing_motions(gap, r)


def packed(shape, seed):
    packing = js.make_packing(shape, n=32, seed=seed, dimension=2, u0=1e-15, progress=False)
    return constraints_of(packing, modes_of(packing))


@pytest.mark.parametrize(
    ("shape", "seed"),
    [
        (js.Spherocylinders(alpha=0.3), 2),  # of seed 1 one mode is free
        (js.Superellipsoids(p=1, w1=0.7, w2=1, size_ratio=1.4), 1),
    ],
    ids=["rods", "ellipses"],
)
def test_hypostatic_packings_have_a_quartic_mode_for_each_missing_contact(shape, seed):
    count = packed(shape, seed)
    assert 0 < count.n_quartic <= count.n_blocked
    assert count.is_matched
    assert (count.n_free, count.n_redundant) == (0, 0)


def test_discs_block_nothing_to_second_order():
    count = packed(js.Spherocylinders(alpha=0.0), 1)
    assert count.n_contacts == count.n_isostatic
    assert (count.n_quartic, count.n_free, count.n_blocked) == (0, 0, 0)


def test_particles_held_by_one_disc_turn_freely():
    """Dimers of discs are isostatic but for those whose contacts are all on one disc."""
    counts = [packed(js.Clumps(discs=js.dimer_discs(0.5)), seed) for seed in (1, 2)]
    assert all(c.n_quartic == 0 and c.is_matched for c in counts)
    assert all(c.n_isostatic - c.n_contacts == c.n_free > 0 for c in counts)
