import numpy as np
from mixtures import bidisperse, of_arrays

from jamshape.contacts import Contacts, find_contacts
from jamshape.drawing.colors import by_kind
from jamshape.drawing.kinds import MOST, kinds_of
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Kind, Particles


def test_small_and_big_particles_of_one_shape():
    packing = random_packing(8, 0.3, 1, bidisperse(4))
    kinds = kinds_of(packing)
    assert kinds.labels == [r"$\alpha=4$, $2R=1$ (4)", r"$\alpha=4$, $2R=1.4$ (4)"]
    assert kinds.title == r"$\alpha=4$"
    assert (kinds.of == (packing.radius > 0.6)).all()


def test_rods_among_discs_are_told_apart_and_named():
    packing = random_packing(6, 0.3, 1, of_arrays([0, 0, 0, 2, 2, 2], [0.7] * 3 + [0.5] * 3))
    kinds = kinds_of(packing)
    assert kinds.labels == [r"$\alpha=0$, $2R=1.4$ (3)", r"$\alpha=4$, $2R=1$ (3)"]
    assert len(set(kinds.of.tolist())) == 2


def test_species_stand_for_kinds_where_sizes_are_spread():
    radius = np.linspace(0.5, 0.7, 20)
    packing = random_packing(20, 0.3, 1, of_arrays(0 * radius, radius, 1 + np.arange(20) % 2))
    kinds = kinds_of(packing)
    assert len(kinds.labels) == 2
    assert all(r"\dots" in label for label in kinds.labels)


def test_particles_that_are_all_different_have_a_scale_and_no_kinds():
    radius = np.linspace(0.5, 0.7, 2 * MOST)
    packing = random_packing(2 * MOST, 0.3, 1, of_arrays(0 * radius, radius))
    assert kinds_of(packing).labels == []
    found = by_kind(Contacts(packing, find_contacts(packing), np.zeros(packing.n, bool)))
    assert len(np.unique(found.rgb, axis=0)) > MOST
    assert [text.split(":")[0] for text, _ in found.legend] == ["smallest", "largest"]


def test_rattlers_are_grey_unless_all_are():
    packing = random_packing(8, 0.3, 1, bidisperse(4))
    network, loose = find_contacts(packing), np.arange(8) == 2
    some = by_kind(Contacts(packing, network, loose))
    assert some.legend[-1][0] == "rattlers (1)"
    assert np.ptp(some.rgb[2]) == 0
    every = by_kind(Contacts(packing, network, np.ones(8, bool)))
    assert len(every.legend) == 2


def test_kinds_are_named_whose_parameters_are_texts():
    particles = Particles.mixture(
        "clump", [Kind({"discs": "0 0 1/1 0 1"}), Kind({"discs": "0 0 1"})]
    )
    kinds = kinds_of(random_packing(6, 0.2, 1, particles))
    assert sorted(kinds.labels) == ["$1$ disc, $s=1$ (3)", "$2$ discs, $s=1$ (3)"]
