"""Small packings of superellipsoids for tests."""

import numpy as np

from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State
from jamshape.minima import Outcome, Stop, minimise
from jamshape.packing import Box, Packing
from methods.lbfgs import lbfgs


def scattered(diameters, exponent, phi, seed=3, dimension=3):
    """Particles anywhere, of any orientation, overlapping or not; the box begins at -1.3."""
    n, rng = len(diameters), np.random.default_rng(seed)
    quaternion = rng.normal(size=(n, 4))
    orientation = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    packing = Packing(
        position=rng.uniform(size=(n, dimension)),
        orientation=orientation if dimension == 3 else rng.uniform(-3, 3, n),
        diameters=diameters,
        species=np.ones(n, int),
        id=np.arange(1, n + 1),
        box=Box(np.zeros(dimension), np.ones(dimension)),
        shape_style="superellipsoid",
        exponent=exponent,
    )
    edge = (packing.phi / phi) ** (1 / dimension)
    box = Box(np.full(dimension, -1.3), np.full(dimension, edge))
    return packing.with_(position=edge * packing.position - 1.3, box=box)


def pressed_superellipsoids(diameters, exponent, phi=0.25, dimension=3):
    """Moved apart, then squeezed until the deepest overlap is 20 %."""
    packing = scattered(
        np.asarray(diameters, float), np.asarray(exponent, float), phi, 3, dimension
    )
    found = minimise(Landscape(packing), State.of(packing), lbfgs, Stop(lowest=1e-12))
    assert found.outcome is Outcome.UNJAMMED
    state = found.state
    for _ in range(300):
        state = state.strained(-0.005)
        bonds = find_contacts(state.packing(packing)).bonds
        if (1 - bonds.distance / bonds.reach).max(initial=0) > 0.2:
            return state.packing(packing).with_(position=state.position.astype(float))
    raise AssertionError


def ellipsoids():
    """Ellipsoids of several shapes and sizes, one of them a sphere."""
    n = 12
    diameters = np.column_stack([np.ones(n), 1 + np.arange(n) / n, 1 + 2 * (np.arange(n) % 3)])
    diameters[0] = 1.0
    return pressed_superellipsoids(diameters, np.ones(n))


def octahedra_and_boxes():
    """Exponents below and above 1 side by side."""
    n = 12
    diameters = np.tile([1.0, 1.2, 1.5], (n, 1))
    return pressed_superellipsoids(diameters, np.where(np.arange(n) % 2, 0.75, 1.5))


def superellipses():
    """In the plane."""
    n = 16
    diameters = np.column_stack([1 + np.arange(n) % 2, np.ones(n), np.ones(n)])
    exponent = np.array([0.8, 1.0, 1.5, 2.0])[np.arange(n) // 2 % 4]
    return pressed_superellipsoids(diameters, exponent, 0.4, dimension=2)
