"""Packings to hand to other programs: of every shape, with places, images and sizes that nothing rounds."""

import numpy as np
from nasty import assert_identical

from jamshape.contacts import find_contacts
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Kind, Particles
from jamshape.shapes.table import SHAPES

RESTS = ("position_rest", "orientation_rest", "edges_rest")

PLACES = [(name, dimension) for name in SHAPES for dimension in (2, 3)]


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


def assert_same(a, b):
    """Compare bit for bit, with what doubles leave out."""
    assert_identical(a, b)
    for name in ("exponent", *RESTS):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name


def touching(name, which=0, angles=(0.3, 1.2)):
    """Two particles in the plane that just touch, the first one at the origin.

    Returns
    -------
    Packing, point of contact (2,), normal into the first one (2,)
    """
    particles = Particles.of(name, 1.4, **SHAPES[name].examples[which])
    packing = random_packing(2, 0.02, 1, particles)
    packing = packing.with_(
        orientation=np.array(angles), box=Box(np.full(2, -20.0), np.full(2, 40.0))
    )

    def apart(distance):
        along = distance * np.array([np.cos(0.8), np.sin(0.8)])
        return packing.with_(position=np.array([[0.0, 0.0], along]))

    near, far = packing.outer_radius.sum() * np.array([0.3, 1.1])
    while far - near > 1e-9:
        middle = (near + far) / 2
        is_near = len(find_contacts(apart(middle)).pairs) > 0
        near, far = (middle, far) if is_near else (near, middle)
    bonds = find_contacts(apart(near)).bonds
    return apart(near), bonds.point[0], bonds.normal[0]
