"""Sums over all pairs of a packing: against those of contacts.forces, and what splitting keeps."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from mixtures import bidisperse
from pair_packings import LONG, LONG_EPS, PairPacking, rods, split
from spherocylinder_pairs import EPS, concatenated, disc_to_disc, tip_to_side, tip_to_tip

from jamshape.contacts import find_contacts, forces
from jamshape.contacts.near import near_particles
from jamshape.packing import Box, State
from jamshape.protocols.random_start import random_packing

K_E = 1.7
MIXTURES = {
    "rods": bidisperse(),
    "short rods": bidisperse(0.01),
    "short rods side by side": bidisperse(0.2),
    "discs": bidisperse(0),
    "size ratio 5": bidisperse(2, 5),
}
EVERY_PACKING = pytest.mark.parametrize(
    ("mixture", "dimension"), [(name, D) for name in MIXTURES for D in (2, 3)]
)
EVERY_LAW = pytest.mark.parametrize("sides", [1, 2])


@cache
def compressed(mixture, dimension):
    """A random packing, squeezed until the deepest overlap is 30 %, turned out of its box."""
    n, phi = {2: (150, 0.45), 3: (120, 0.25)}[dimension]
    packing = random_packing(n, phi, 3, MIXTURES[mixture], dimension=dimension)
    while True:
        edges = 0.99 * packing.box.edges
        packing = packing.with_(box=Box(packing.box.lo, edges), position=0.99 * packing.position)
        found = find_contacts(packing).bonds
        if (1.0 - found.distance / found.reach).max(initial=0.0) > 0.3:
            break
    rng = np.random.default_rng(5)
    turns = rng.integers(-2, 3, packing.position.shape)
    packing = packing.with_(position=packing.position + turns * packing.box.edges)
    if mixture != "short rods side by side":
        return packing
    turn = 5e-3 * rng.normal(size=packing.orientation.shape)  # two bonds are one below 0.01
    if dimension == 3:
        turn[:, 0] = 1.0
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    return packing.with_(orientation=turn)


def arguments(packing):
    near = near_particles(State.of(packing), packing.compiled())
    position, orientation, cell = packing.poses()
    poses = (split(x) for x in (position, orientation.reshape(packing.n, -1), cell))
    return [*poses, np.column_stack([near.first, near.second]), near.shift]


def compiled(packing, sides):
    return rods(packing.diameters, packing.dimension, K_E, sides)


@EVERY_LAW
@EVERY_PACKING
@pytest.mark.parametrize("extended", [False, True])
def test_sums_are_those_of_the_forces_of_the_packing(mixture, dimension, sides, extended, measured):
    packing = compressed(mixture, dimension)
    network, expected = find_contacts(packing, K_E, sides), forces(packing, K_E, sides)
    found = compiled(packing, sides).sums(*arguments(packing), extended)
    assert found["crossing"] == -1
    assert found["n_bonds"] == network.n_bonds.sum()
    bond_force = np.linalg.norm(network.bonds.force, axis=1).sum()
    largest = np.linalg.norm(network.force, axis=1).max()
    lever = (packing.half_length + packing.radius).max()
    worst = {
        "energy": abs(found["energy"] / expected.energy - 1.0),
        "force": np.abs(found["force"] - expected.force).max() / largest,
        "torque": np.abs(found["torque"].reshape(expected.torque.shape) - expected.torque).max()
        / (largest * lever),
        "virial": np.abs(found["virial"] - expected.virial).max() / np.trace(expected.virial),
        "bond_force": abs(found["bond_force"] / bond_force - 1.0),
    }
    measured(**worst)
    assert len(network.pairs) > 20
    assert max(worst.values()) < 1e-12


@pytest.mark.parametrize("dimension", [2, 3])
def test_forces_and_torques_of_a_packing_balance(dimension, measured):
    packing = compressed("rods", dimension)
    found = compiled(packing, 2).sums(*arguments(packing), True)
    net = np.abs(found["force"].sum(axis=0)).max() / found["bond_force"]
    # With the torques about the centres, the virial has no antisymmetric part left.
    twist = found["virial"] - found["virial"].T
    if dimension == 2:
        left = twist[0, 1] + found["torque"].sum()
    else:
        left = np.array([twist[1, 2], twist[2, 0], twist[0, 1]]) + found["torque"].sum(axis=0)
    measured(net_force=net, net_torque=np.abs(left).max() / np.trace(found["virial"]))
    assert net < EPS
    assert np.abs(left).max() < 32.0 * EPS * np.trace(found["virial"])


@pytest.mark.parametrize("extended", [False, True])
def test_a_particle_touches_its_own_image(extended):
    """A rod in a box lower than its width: two bonds with its image, which push on nothing."""
    rod = rods(np.array([[13.0, 1.0, 1.0]]), 2, K_E, 2)  # long, and so with two whole bonds
    position, cell = np.zeros((2, 1, 2)), np.zeros((2, 2, 2))
    position[0], cell[0] = (0.3, -7.1), np.diag([40.0, 0.9])
    orientation = np.zeros((2, 1, 1))
    pairs, shift = np.zeros((1, 2), np.int64), np.array([[0, -1]])
    found = rod.sums(position, orientation, cell, pairs, shift, extended)
    overlap = 1.0 - 0.9
    assert found["n_bonds"] == 2
    np.testing.assert_allclose(found["energy"], K_E * overlap**2)
    np.testing.assert_allclose(found["virial"], [[0.0, 0.0], [0.0, 2.0 * K_E * overlap * 0.9]],
                               atol=1e-16)  # fmt: skip
    assert not np.any(found["force"])
    np.testing.assert_allclose(found["torque"], 0.0, atol=1e-16)


# --- split coordinates -------------------------------------------------------------------------


def shallow_pairs(dimension):
    """Overlaps of 1e-9, where a force in doubles has seven digits."""
    rng = np.random.default_rng([51, dimension])
    n = 200
    overlap = np.full(n, 1e-9)
    pairs = [
        disc_to_disc(rng, n, dimension, overlap),
        tip_to_tip(rng, n, dimension, overlap, (0.1, 4.0)),
        tip_to_side(rng, n, dimension, overlap, (0.1, 4.0)),
    ]
    return PairPacking.of(rng, concatenated(*pairs))


def with_other_digits(rng, parts, bits):
    """The same numbers, of the doubles only `bits` bits (of the largest), the others in the rests."""
    double, rest = parts
    unit = 2.0 ** (np.ceil(np.log2(np.abs(double).max())) - bits)
    coarse = unit * (np.round(double / unit) + rng.integers(-3, 4, double.shape))
    moved = double - coarse
    assert np.array_equal(coarse + moved, double)
    return np.stack([coarse, moved + rest])


@EVERY_LAW
@pytest.mark.parametrize("dimension", [2, 3])
def test_digits_may_stand_in_the_doubles_or_in_their_rests(dimension, sides, measured):
    rng = np.random.default_rng([52, dimension])
    packing = shallow_pairs(dimension)
    position, orientation, cell, pairs, shift = packing.arguments()
    edges = np.diagonal(cell, axis1=1, axis2=2)
    d = packing.plain().d.astype(float)
    found = packing.sums(sides, K_E)
    coordinate = np.abs(position[0]).max()
    for bits in (45, 40, 36):
        other = (
            with_other_digits(rng, position, bits),
            with_other_digits(rng, orientation, bits),
            np.stack([np.diag(part) for part in with_other_digits(rng, edges, bits)]),
        )
        again = packing.compiled(sides, K_E).sums(*other, pairs, shift, True)
        force = np.abs(again["force"] - found["force"])[::2].max(axis=1) * d**2 / K_E
        lever = d * (packing.diameters[::2, 0] + packing.diameters[1::2, 0])
        torque = np.abs(again["torque"] - found["torque"]).max(axis=1).reshape(-1, 2).max(axis=1)
        torque = torque * d**2 / (K_E * lever)
        measured(**{f"force_{bits}": force.max(), f"torque_{bits}": torque.max()})
        unit = LONG_EPS * coordinate
        assert force.max() < 8.0 * unit
        assert torque.max() < 8.0 * unit
        np.testing.assert_allclose(again["energy"], found["energy"], rtol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_overlaps_of_1e_12_far_from_the_origin_keep_six_digits(dimension, measured):
    rng = np.random.default_rng([53, dimension])
    n = 500
    overlap = np.full(n, 1e-12)
    direction = rng.normal(size=(n, dimension)).astype(LONG)
    direction /= np.sqrt((direction**2).sum(axis=1, keepdims=True))
    apart = (1.0 - overlap[:, None].astype(LONG)) * direction
    first = rng.uniform(-1000.0, 1000.0, (n, dimension))
    second = (first + apart).astype(float)
    rest = (apart - (second.astype(LONG) - first)).astype(float)  # the difference is exact
    position = np.zeros((2, 2 * n, dimension))
    position[0, ::2], position[0, 1::2], position[1, 1::2] = first, second, rest
    orientation = np.zeros((2, 2 * n, 1 if dimension == 2 else 4))
    orientation[0, :, 0] = 1.0
    cell = np.stack([3000.0 * np.eye(dimension), np.zeros((dimension, dimension))])
    pairs, shift = np.arange(2 * n).reshape(n, 2), np.zeros((n, dimension), np.int64)
    discs = rods(np.ones((2 * n, 3)), dimension, K_E, 2)
    poses = (position, orientation, cell, pairs, shift)
    found = discs.sums(*poses, True)
    assert found["n_bonds"] == n
    force = np.linalg.norm(found["force"][::2], axis=1) / K_E
    error = np.abs(force / overlap - 1.0).max()
    measured(worst=error, worst_of_energy=abs(found["energy"] / (0.5 * K_E * n * 1e-24) - 1.0))
    assert error < 1e-6
    assert abs(found["energy"] / (0.5 * K_E * n * 1e-24) - 1.0) < 1e-6
    derivatives = discs.derivatives(*poses, True)
    assert np.abs(derivatives["bond_force"][:, 0] / (K_E * overlap) - 1.0).max() < 1e-6
    # The same without the rests is noise.
    poses = (position * [[[1.0]], [[0.0]]], *poses[1:])
    blurred = np.linalg.norm(discs.sums(*poses, True)["force"], axis=1)
    assert np.median(np.abs(blurred[::2] / (K_E * overlap) - 1.0)) > 1e-3


@EVERY_PACKING
def test_precisions_agree_to_the_rounding_of_doubles(mixture, dimension, measured):
    packing = compressed(mixture, dimension)
    double, long = (
        compiled(packing, 2).sums(*arguments(packing), extended) for extended in (False, True)
    )
    worst = {
        name: np.abs(np.asarray(double[name]) - long[name]).max() / np.abs(long[name]).max()
        for name in ("energy", "force", "torque", "virial", "bond_force")
        if np.any(long[name])
    }
    measured(**worst)
    assert double["n_bonds"] == long["n_bonds"]
    assert max(worst.values()) < 1e-13


# --- arguments ---------------------------------------------------------------------------------


def sums(*, diameters, k_e, sides, cell, **poses):
    """Sums over new particles; the dimension is that of the box."""
    return rods(diameters, cell.shape[1], k_e, sides).sums(cell=cell, **poses)


def derivatives(*, diameters, k_e, sides, cell, **poses):
    return rods(diameters, cell.shape[1], k_e, sides).derivatives(cell=cell, **poses)


FUNCTIONS = pytest.mark.parametrize("function", [sums, derivatives])


def two_rods(dimension):
    turns = 1 if dimension == 2 else 4
    orientation = np.zeros((2, 2, turns))
    orientation[0, :, 0] = 1.0
    position = np.zeros((2, 2, dimension))
    position[0, 1, 1] = 0.9
    cell = np.zeros((2, dimension, dimension))
    cell[0] = 20.0 * np.eye(dimension)
    return {
        "diameters": np.tile([3.0, 1.0, 1.0], (2, 1)),
        "position": position,
        "orientation": orientation,
        "cell": cell,
        "pairs": np.array([[0, 1]]),
        "shift": np.zeros((1, dimension), np.int64),
        "k_e": K_E,
        "sides": 2,
        "extended": True,
    }


BAD = {
    "diameters": [np.ones((2, 2)), np.array([[1.0, 3.0, 3.0]] * 2), np.array([[3.0, 1.0, 2.0]] * 2),
                  np.array([[3.0, 0.0, 0.0]] * 2), np.array([[np.inf, 1.0, 1.0]] * 2)],
    "position": [np.zeros((1, 2, 2)), np.zeros((2, 3, 2)), np.zeros((2, 2, 3)),
                 np.zeros((2, 2, 1))],
    "orientation": [np.zeros((1, 2, 1)), np.zeros((2, 1, 1)), np.zeros((2, 2, 4))],
    "cell": [np.ones((1, 2, 2)), np.ones((2, 1, 2)), np.ones((2, 2, 3)), np.ones((2, 2, 2)),
             np.zeros((2, 2, 2)), np.full((2, 2, 2), np.inf)],
    "pairs": [np.array([[0, 1, 1]]), np.array([[0, 2]]), np.array([[-1, 1]]),
              np.array([[0, 1], [0, 1]])],
    "shift": [np.zeros((1, 3), np.int64), np.zeros((2, 2), np.int64), np.zeros((1, 1), np.int64)],
    "k_e": [0.0, -1.0, np.nan],
    "sides": [0, 3],
}  # fmt: skip


@FUNCTIONS
@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in BAD.items() for value in values]
)
def test_bad_arguments_are_refused_in_one_sentence(function, name, value):
    with pytest.raises(ValueError) as refused:
        function(**(two_rods(2) | {name: value}))
    message = str(refused.value)
    assert message.endswith(".")
    assert message.count(". ") == 0
    assert len(message) > 20


@FUNCTIONS
def test_quaternions_are_asked_for_in_space(function):
    with pytest.raises(ValueError, match=r"quaternions|4"):
        function(**(two_rods(3) | {"orientation": np.zeros((2, 2, 1))}))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("extended", [False, True])
def test_no_pairs_have_no_energy(dimension, extended):
    none = {"pairs": np.zeros((0, 2), np.int64), "shift": np.zeros((0, dimension), np.int64)}
    found = sums(**(two_rods(dimension) | none | {"extended": extended}))
    assert (found["energy"], found["bond_force"], found["n_bonds"]) == (0.0, 0.0, 0)
    assert found["crossing"] == -1
    assert found["force"].shape == (2, dimension)
    assert found["torque"].shape == (2, 1 if dimension == 2 else 3)
    assert found["virial"].shape == (dimension, dimension)
    assert not any(np.any(found[name]) for name in ("force", "torque", "virial"))
    n = 4 if dimension == 2 else 9
    found = derivatives(**(two_rods(dimension) | none))
    assert found["curvature"].shape == (0, n, n)


@EVERY_LAW
@pytest.mark.parametrize("extended", [False, True])
def test_crossing_is_reported_with_the_first_row_of_its_pairs(sides, extended):
    """Three rods: the first two touch, the third crosses both."""
    two = two_rods(2)
    position = np.zeros((2, 3, 2))
    position[0] = [[0.0, 0.0], [0.0, 0.9], [0.5, 0.4]]
    orientation = np.zeros((2, 3, 1))
    orientation[0, 2] = 0.5 * np.pi
    two |= {
        "diameters": np.tile([3.0, 1.0, 1.0], (3, 1)),
        "position": position,
        "orientation": orientation,
        "sides": sides,
        "extended": extended,
    }

    def crossing(*pairs):
        shift = np.zeros((len(pairs), 2), np.int64)
        return sums(**(two | {"pairs": np.array(pairs), "shift": shift}))

    assert crossing([0, 1])["crossing"] == -1
    assert crossing([0, 1], [1, 2])["crossing"] == 1
    assert crossing([0, 1], [0, 2], [1, 2])["crossing"] == 1
    assert crossing([2, 0], [0, 1], [1, 2])["crossing"] == 0
    # What crosses adds nothing to the sums.
    assert crossing([0, 1], [1, 2])["energy"] == crossing([0, 1])["energy"]
    assert crossing([2, 1], [1, 2])["energy"] == 0.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_centres_on_each_other_are_crossing(dimension):
    two = two_rods(dimension) | {"diameters": np.ones((2, 3))}
    two["position"] = np.zeros((2, 2, dimension))
    assert sums(**two)["crossing"] == 0
    assert len(derivatives(**two)["pair"]) == 0


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("images", "tilted"), [(0, 0), (1, 0), (3, 0), (1, 1), (3, 1)])
def test_separations_are_right_to_the_last_bit_of_doubles(images, tilted, dimension):
    """Particles are 40 diameters out, from 1e-9 to 1 apart, in the same image and in others."""
    rng, n = np.random.default_rng(17), 300
    cell = LONG(1) * np.triu(rng.uniform(-20.0, 20.0, (dimension, dimension)), 1) * tilted
    cell += np.diag(LONG(1) * rng.uniform(35.0, 45.0, dimension))
    shift = rng.integers(-images, images + 1, (n, dimension))
    apart = LONG(1) * 10.0 ** rng.uniform(-9.0, -0.3, (n, 1)) * rng.normal(size=(n, dimension))
    second = rng.uniform(-40.0, 40.0, (n, dimension)).astype(LONG)
    position = split(np.stack([second + shift @ cell.T + apart, second], 1).reshape(2 * n, -1))
    turn = split(np.tile([[0.0]] if dimension == 2 else np.eye(1, 4), (2 * n, 1)))
    pairs, discs = np.arange(2 * n).reshape(-1, 2), rods(np.full((2 * n, 3), 20.0), dimension)
    found = discs.derivatives(position, turn, split(cell), pairs, shift, False)["separation"]
    x, vectors = exactly(position), exactly(split(cell))
    expected = x[::2] - x[1::2] - np.vectorize(Fraction)(shift) @ vectors.T
    error = np.abs((np.vectorize(Fraction)(found) - expected).astype(float))
    assert found.shape == (n, dimension)
    assert np.all(error <= 0.5001 * np.spacing(np.abs(found)))


def exactly(parts):
    """Sums of doubles (2, ...) and their rests as fractions."""
    return np.vectorize(Fraction)(parts).sum(axis=0)
