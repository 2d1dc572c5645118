"""Packings of dimers in the plane have just as many bonds as hold them: Schreck, Xu & O'Hern 2010.

A dimer one of whose discs nothing touches turns about the other disc at no cost at all; every other freedom of the
backbone takes one bond, with one more for the pressure (the one state of self stress) and two less for translations.
"""

import numpy as np
import pytest

from jamshape.contacts import find_contacts
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.landscape import Landscape, State
from jamshape.minima.target import Target
from jamshape.protocols.make import Recipe, Steps, make
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.shapes.particles import Particles
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.statistics import count


def made(tmp_path, alpha, seed):
    way = Steps(Quasistatic(step=5e-3))
    particles = Particles.of("dimer", alpha=alpha)
    recipe = Recipe(particles, 32, 2, seed, 0.4, way, Target(1e-12))
    out = tmp_path / "packing.h5"
    make(recipe, out)
    return out


def with_a_bare_disc(packing, network, backbone):
    """Count the dimers of the backbone that are touched at one of their two discs only."""
    touched = np.zeros((packing.n, 2), bool)
    bonds = network.bonds
    pairs = network.pairs[bonds.contact]
    for side in (0, 1):
        arm = bonds.point - packing.position[pairs[:, side]]
        if side:
            arm = arm + bonds_shift(packing, network)
        end = (np.einsum("bk,bk->b", arm, packing.axes[pairs[:, side]]) < 0).astype(int)
        touched[pairs[:, side], end] = True
    return int((touched.sum(axis=1)[backbone] == 1).sum())


def bonds_shift(packing, network):
    """From the centre of i to that of the image of j that is touched, as seen from j."""
    pairs, contact = network.pairs, network.bonds.contact
    plain = packing.position[pairs[:, 1]] - packing.position[pairs[:, 0]]
    return (plain + network.separation)[contact]


@pytest.mark.parametrize(("alpha", "seed"), [(0.4, 1), (0.4, 2), (1.0, 1), (1.0, 3)])
def test_bonds_are_as_many_as_freedoms(tmp_path, alpha, seed):
    out = made(tmp_path, alpha, seed)
    packing, stored = read_packing(out), read_attributes(out)
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    counts = count(matrix, spectrum(matrix))
    n, n_turning = (
        matrix.n_particles,
        with_a_bare_disc(packing, find_contacts(packing, sides=2), matrix.coordinates.backbone),
    )
    assert matrix.size == 3 * n
    assert counts.n_floppy == n_turning
    assert matrix.n_bonds == stored["n_bonds"] == 3 * n - 1 - n_turning
    assert counts.rank == matrix.n_bonds - 1
