"""Ends of rods in space that have contacts: pairs whose contacts are known, and packings at rest."""

import dataclasses

import numpy as np
import pytest

import jamshape as js
from common.end_contacts import end_contacts, touched_ends
from jamshape.contacts import Contacts, find_contacts

ALPHA = 4.0  # spines from -2 to 2, with 2R = 1
APART = 0.99  # distance of spines that touch
X, Y, Z = [1, 0, 0, 0], [0.5**0.5, 0, 0, 0.5**0.5], [0.5**0.5, 0, -(0.5**0.5), 0]
BACK = [0, 0, 0, 1]  # along -x

# Centres and directions: two crossed rods, the end of one on the side of the other, and three in a row, of which the last
# points back.
SIDES = [[10, 10, 10], [10.3, 10.2, 10 + APART]], [X, Y]
ON_SIDE = [[20, 20, 20], [20.4, 20, 22 + APART]], [X, Z]
ROW = [[1, 30, 30], [5 + APART, 30, 30], [9 + 2 * APART, 30, 30]], [X, X, BACK]


def held(packing):
    """Contacts without rattlers."""
    return Contacts(packing, find_contacts(packing), np.zeros(packing.n, bool))


def of(*groups):
    position, orientation = (np.concatenate(values) for values in zip(*groups, strict=True))
    packing = js.Packing.of("spherocylinder", position, orientation, box=[40] * 3, alpha=ALPHA)
    return held(packing)


@pytest.fixture(scope="module")
def at_rest():
    shape = js.Spherocylinders(alpha=8.0, size_ratio=1)
    return js.make_packing(shape, n=48, seed=2, dimension=3, u0=1e-15, progress=False)


def test_contacts_are_counted_by_ends():
    found = end_contacts(of(SIDES, ON_SIDE, ROW))
    assert found[:3] == (1 / 4, 1 / 4, 2 / 4)
    assert found[3:6] == pytest.approx((3 / 7, 3 / 7, 1 / 7))
    assert found.z == pytest.approx(2 * 4 / 7)
    assert found.z_blocked == pytest.approx(2 * (7 * 5 - 3 - 3 + 1) / 7)
    assert found.is_isostatic == 0


def test_ends_of_each_rod():
    assert touched_ends(of(SIDES, ON_SIDE, ROW)).tolist() == [0, 0, 0, 1, 1, 2, 1]
    across_the_edge = np.array(ROW[0]) - [10, 0, 0]
    assert touched_ends(of((across_the_edge, ROW[1]))).tolist() == [1, 2, 1]


def test_contacts_of_rattlers_do_not_count():
    found = of(SIDES, ON_SIDE, ROW)
    without = dataclasses.replace(found, rattlers=np.arange(7) == 6)
    assert touched_ends(without).tolist() == [0, 0, 0, 1, 1, 1, 0]
    assert end_contacts(without)[:3] == pytest.approx((1 / 3, 1 / 3, 1 / 3))


def test_parallel_rods_side_by_side_do_not_touch_at_ends():
    found = of(([[10, 10, 10], [10.7, 10 + APART, 10]], [X, X]))
    assert found.network.n_bonds.tolist() == [2]
    assert touched_ends(found).tolist() == [0, 0]
    assert end_contacts(found).side_to_side == 1


def test_grazing_bonds_do_not_count():
    row = np.array(ROW[0])
    row[2, 0] += 0.01 - 1e-9
    found = of(SIDES, ON_SIDE, (row, ROW[1]))
    assert len(found) == 4
    assert touched_ends(found).tolist() == [0, 0, 0, 1, 1, 1, 0]
    assert end_contacts(found).z == pytest.approx(2 * 3 / 7)


def test_rods_at_rest_have_contacts_at_both_ends_or_at_neither(at_rest):
    """Without friction, only contacts at ends push a rod along its axis."""
    found = at_rest.contacts()
    ends = touched_ends(found)
    assert set(ends[~found.rattlers]) == {0, 2}
    of_rods = end_contacts(found)
    assert of_rods.at_one == 0
    n = np.count_nonzero(~found.rattlers)
    assert of_rods.z_blocked == pytest.approx(8 + 2 * of_rods.at_both - 4 / n)


def test_rods_at_neither_end_slide_without_force(at_rest):
    """Axial forces of contacts beside the ends vanish, contact by contact."""
    found = at_rest.contacts()
    bonds, axes = found.network.bonds, at_rest.axes
    size = np.linalg.norm(bonds.force, axis=1)
    for k in range(2):
        along = np.abs((bonds.force * axes[found.pairs[bonds.contact, k]]).sum(axis=1)) / size
        assert along[bonds.on_side[:, k]].max() < 1e-9
        assert along[~bonds.on_side[:, k]].min() > 1e-6


def test_heads_of_rods_do_not_matter(at_rest):
    w, i, j, k = at_rest.orientation.T
    turned = at_rest.with_(orientation=np.column_stack([-k, j, -i, w]))  # about the body's z by pi
    np.testing.assert_allclose(turned.axes, -at_rest.axes, atol=1e-12)
    rattlers = at_rest.contacts().rattlers
    one, two = (Contacts(p, find_contacts(p), rattlers) for p in (at_rest, turned))
    np.testing.assert_array_equal(touched_ends(one), touched_ends(two))


@pytest.mark.parametrize(("alpha", "dimension"), [(0.0, 3), (1.0, 2)])
def test_what_has_no_ends_is_refused(alpha, dimension):
    packing = js.Packing.of(
        "spherocylinder", np.eye(2, dimension), [[1, 0, 0, 0]] * 2 if dimension == 3 else [0, 0],
        box=[9] * dimension, alpha=alpha,
    )  # fmt: skip
    with pytest.raises(ValueError, match="expected rods in 3D"):
        end_contacts(held(packing))
