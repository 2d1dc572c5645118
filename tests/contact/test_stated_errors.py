"""Errors that contacts of every shape state: those of closed formulas are not 0, either."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from jamshape import _contact
from jamshape.contacts import find_contacts
from jamshape.packing import Box, Packing

PAIRS = 400


def shapes_and_poses(name, dimension):
    """Pairs beside each other, parallel to 1e-12 to 1, with overlaps of all sizes."""
    rng = np.random.default_rng(3)
    diameters = np.tile([3.0, 1.0, 1.0], (2 * PAIRS, 1))
    shapes = getattr(_contact, name)(diameters, np.ones(2 * PAIRS), dimension, 1.0, 2)
    tilt = np.exp(rng.uniform(np.log(1e-12), 0, 2 * PAIRS))
    if dimension == 2:
        turn = tilt[:, None]
    else:
        turn = np.column_stack(
            [np.ones(2 * PAIRS), tilt[:, None] * rng.normal(size=(2 * PAIRS, 3))]
        )
    position = np.zeros((2 * PAIRS, dimension))
    position[1::2, 0] = rng.uniform(-1, 1, PAIRS)
    position[1::2, 1] = 1 - np.exp(rng.uniform(np.log(1e-10), np.log(0.3), PAIRS))
    split = [np.stack([x, 0 * x]) for x in (position, turn, 100.0 * np.eye(dimension))]
    pairs = np.arange(2 * PAIRS).reshape(PAIRS, 2)
    return shapes, (*split, pairs, np.zeros((PAIRS, dimension), np.int64))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", ["Spherocylinders", "Dimers"])
def test_closed_formulas_state_what_rounding_does(name, dimension, measured):
    shapes, at = shapes_and_poses(name, dimension)
    found, wide = shapes.contacts(*at, False, True), shapes.contacts(*at, True, True)
    both = np.intersect1d(found["pair"], wide["pair"], return_indices=True)[1:]
    assert len(both[0]) > 50
    for key in ("energy", "force", "torque"):
        names = ("torque_i", "torque_j") if key == "torque" else (key,)
        error = found[f"{key}_error"][both[0]]
        for of in names:
            off = (found[of][both[0]] - wide[of][both[1]]).reshape(len(error), -1)
            size = np.linalg.norm(off, axis=1)
            measured(**{of: np.nanmax(size / error)})
            assert np.all(size <= error + wide[f"{key}_error"][both[1]])
        assert np.all(error > 0)
        assert np.all(np.isfinite(error))
    relative = found["energy_error"] / found["energy"]
    assert np.median(relative) < 1e-8  # as overlaps are 1e-5


def test_contacts_of_a_packing_have_errors_where_asked_for():
    packing = Packing(
        position=np.array([[0.0, 0.0, 0.0], [0.0, 0.9, 0.0]]),
        orientation=np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)),
        diameters=np.ones((2, 3)),
        species=np.ones(2, int),
        id=np.array([1, 2]),
        box=Box(np.full(3, -5.0), np.full(3, 10.0)),
        shape_style="superellipsoid",
        exponent=np.full(2, 8.0),
    )
    assert find_contacts(packing).errors is None
    network = find_contacts(packing, errors=True)
    exact = (1 - Fraction(0.9) ** 2) ** 2 / 2
    assert abs(Fraction(network.energy[0]) - exact) <= network.errors.energy[0]
    assert network.errors.energy[0] < 1e-15
    assert network.errors.force[0] < 1e-14
    assert network.errors.torque[0] < 0.5 * np.linalg.norm(
        network.force
    )  # on faces, the point is open
