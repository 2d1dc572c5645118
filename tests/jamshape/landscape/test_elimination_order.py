"""Orders of elimination: complete, and with less fill-in than others."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from jamshape import _contact


def neighbours_in(dimension, n, seed=1):
    """Random positions in a periodic box of edge 1, and the pairs of about six neighbours each."""
    position = np.random.default_rng(seed).random((n, dimension))
    ball = np.pi if dimension == 2 else 4 / 3 * np.pi
    reach = (6 / (n * ball)) ** (1 / dimension)
    pairs = cKDTree(position, boxsize=1.0).query_pairs(reach, output_type="ndarray")
    return position, pairs.astype(np.int64)


def operations(n, pairs, place):
    """Products of an elimination in this order, by elimination itself."""
    later = [set() for _ in range(n)]
    for i, j in place[pairs]:
        later[min(i, j)].add(max(i, j))
    products = 0
    for below in later:
        products += len(below) ** 2
        if below:
            parent = min(below)
            later[parent] |= below - {parent}
    return products


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("n", [1, 7, 8, 300])
def test_every_particle_has_a_place_of_its_own(dimension, n):
    place = _contact.elimination_order(*neighbours_in(dimension, n))
    assert sorted(place) == list(range(n))


@pytest.mark.parametrize("dimension", [2, 3])
def test_elimination_takes_far_fewer_operations_than_in_another_order(dimension):
    n = 1500
    position, pairs = neighbours_in(dimension, n)
    found = operations(n, pairs, _contact.elimination_order(position, pairs))
    by_place = np.empty(n, dtype=np.int64)
    by_place[np.argsort(position[:, 0])] = np.arange(n)  # a band matrix
    assert found < 0.4 * operations(n, pairs, by_place)


def test_no_pair_crosses_the_first_cut():
    """What is left of the two halves without their separator falls apart: the last places."""
    n = 1500
    position, pairs = neighbours_in(3, n)
    place = _contact.elimination_order(position, pairs)
    for separator in range(1, n // 4):
        if parts_without(n, pairs, place < n - separator) > 1:
            break
    else:
        pytest.fail("The last quarter of the places separates nothing.")
    assert separator > 50


def parts_without(n, pairs, kept):
    """Number of large parts that the kept particles form."""
    inside = pairs[kept[pairs].all(axis=1)]
    graph = coo_matrix((np.ones(len(inside)), inside.T), shape=(n, n))
    _, of = connected_components(graph, directed=False)
    sizes = np.bincount(of[kept])
    return int((sizes > n // 4).sum())


def test_coincident_particles_and_pairs_that_repeat_have_an_order():
    pairs = np.array([[0, 1], [1, 0], [3, 3], [2, 9], [9, 2]])
    place = _contact.elimination_order(np.zeros((12, 3)), pairs)
    assert sorted(place) == list(range(12))


def test_pairs_of_particles_that_do_not_exist_are_refused():
    for pairs in ([[0, 3]], [[-1, 0]]):
        with pytest.raises(ValueError, match="does not exist"):
            _contact.elimination_order(np.zeros((3, 3)), np.array(pairs))
