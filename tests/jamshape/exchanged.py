"""Packings to hand to other programs: of every shape, with places, images and sizes that nothing rounds."""

import numpy as np
from nasty import assert_identical

from jamshape.contacts import find_contacts
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Kind, Particles
from jamshape.shapes.table import SHAPES

RESTS = ("position_rest", "orientation_rest", "edges_rest", "tilt_rest")

PLACES = [(name, dimension) for name in SHAPES for dimension in SHAPES[name].dimensions]


def mixed(name, dimension, spread=0.05, n=12):
    """All examples of a shape in one box, which begins somewhere; some particles are out of it."""
    kinds = [
        Kind(parameters, size=1 + k / 7, spread=spread)
        for k, parameters in enumerate(SHAPES[name].examples)
    ]
    phi = {2: 0.3, 3: 0.15}[dimension]
    packing = random_packing(n, phi, 3, Particles.mixture(name, kinds), dimension)
    rng, lo = np.random.default_rng(1), np.linspace(-1 / 3, 0.4, dimension)
    return packing.with_(
        position=packing.position + lo + packing.box.edges * rng.integers(-1, 2, (n, dimension)),
        box=Box(lo, packing.box.edges),
        image=rng.integers(-2, 3, (n, dimension)),
        id=rng.permutation(n) + 1,
        step=12345678901,
        time=1 / 7,
    )


def tilted(name, dimension):
    """The same in a box with a tilt."""
    packing = mixed(name, dimension)
    tilt = packing.box.edges[0] * np.array([0.3, -0.4, 0.2])[: 2 * dimension - 3]
    return packing.with_(box=Box(packing.box.lo, packing.box.edges, tilt))


def assert_same(a, b):
    """Compare bit for bit, with what doubles leave out."""
    assert_identical(a, b)
    assert a.law == b.law
    for name in ("form", *RESTS):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name


def touching(name, orientations):
    """Two particles that just touch, the first one at the origin.

    Returns
    -------
    Packing, point of contact (D,), normal into the first one (D,)
    """
    orientations = np.array(orientations)
    D = 2 if orientations.ndim == 1 else 3
    particles = Particles.of(name, 1.4, **SHAPES[name].examples[0])
    packing = random_packing(2, 0.01, 1, particles, D)
    box = Box(np.full(D, -20.0), np.full(D, 40.0))
    packing = packing.with_(orientation=orientations, box=box)
    toward = np.array([0.7, 0.6, 0.4])[:D] / np.linalg.norm([0.7, 0.6, 0.4][:D])

    def apart(distance):
        return packing.with_(position=np.array([np.zeros(D), distance * toward]))

    def touch(distance):
        return len(find_contacts(apart(distance)).pairs) > 0

    near = far = packing.outer_radius.sum()
    while not touch(near):
        near, far = 0.97 * near, near
    while far - near > 1e-6:
        middle = (near + far) / 2
        near, far = (middle, far) if touch(middle) else (near, middle)
    bonds = find_contacts(apart(near)).bonds
    return apart(near), bonds.point[0], bonds.normal[0]
