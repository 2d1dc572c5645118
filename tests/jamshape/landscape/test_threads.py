"""Contacts shared by threads: the same sums to rounding, and the same bits by the same number of threads."""

from functools import cache

import numpy as np
import pytest
from mixtures import bidisperse

from jamshape import _contact
from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.landscape.threads import sharing, threads
from jamshape.protocols.random_start import dilute_packing, random_packing
from jamshape.shapes.particles import Particles

SHARED_FROM = 2000  # pairs


@cache
def crowd(name):
    """Particles at random places, more pairs of them than one thread evaluates, and their state squeezed."""
    if name == "ellipsoids":
        particles = Particles.of("superellipsoid", p=1.0, w1=0.7, w2=1.0)
        packing, strain = dilute_packing(500, 0.3, 3, particles, 3), -0.25
    else:
        alpha, n = {"discs": (0, 1500), "rods": (4, 1000)}[name]
        packing, strain = random_packing(n, 0.45, 3, bidisperse(alpha)), -0.3
    state = State.of(packing).strained(strain)
    assert len(Landscape(packing).pairs_at(state).particles) >= SHARED_FROM
    return packing, state


def evaluated(name, number, extended=False):
    """Evaluate, and factorise, near the state by so many threads."""
    packing, state = crowd(name)
    with sharing(number):
        local_model = LocalEnergyModel(Landscape(packing), state)
    x = 1e-3 * np.random.default_rng(2).normal(size=local_model.landscape.size)
    found = local_model.evaluate(x, 1e-4, extended=extended)
    factors = local_model.factorise(0.0 * x, 0.0, np.full(len(x), 10.0))
    return found, factors.solve(found.gradient)


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("name", ["discs", "ellipsoids"])
def test_sums_are_the_same_by_any_number_of_threads(name, extended):
    one, solution = evaluated(name, 1, extended)
    assert one.n_bonds > SHARED_FROM / 2
    for number in (2, 3):
        found, solved = evaluated(name, number, extended)
        assert found.n_bonds == one.n_bonds
        assert found.gradient == pytest.approx(
            one.gradient, rel=0, abs=1e-14 * abs(one.gradient).max()
        )
        for of in ("energy", "strain_gradient", "bond_force"):
            assert getattr(found, of) == pytest.approx(getattr(one, of), rel=1e-13)
        assert solved == pytest.approx(solution, rel=0, abs=1e-11 * abs(solution).max())
        again, solved_again = evaluated(name, number, extended)
        assert again.energy == found.energy
        assert np.array_equal(again.gradient, found.gradient)
        assert np.array_equal(solved_again, solved)


@pytest.mark.parametrize("number", [1, 2, 3, 7])
def test_of_pairs_that_cross_the_first_is_named(number):
    packing, state = crowd("rods")
    with sharing(number):
        local_model = LocalEnergyModel(Landscape(packing), state)
    with pytest.raises(CrossingError) as crossing:
        local_model.evaluate(np.zeros(local_model.landscape.size), 0.0, extended=False)
    with pytest.raises(CrossingError) as expected:
        Landscape(packing).evaluate(state)
    assert str(crossing.value) == str(expected.value)


@pytest.mark.parametrize("number", [1, 2, 5])
def test_what_is_thrown_in_threads_is_thrown_to_who_asked_and_the_threads_go_on(number):
    counts, failed = _contact.counts_of_team(number, number // 2, 30)
    assert (counts == 30).all()
    assert failed == f"part {number // 2} failed"


@pytest.mark.parametrize("number", [0, -1, 1.5, True])
def test_what_is_no_number_of_threads_is_refused(number):
    with pytest.raises(ValueError, match="expected a whole number of threads"), sharing(number):
        pass
    assert threads() == 1
    packing, state = crowd("discs")
    with pytest.raises(ValueError, match="expected from 1 to 1024"):
        LocalEnergyModel(Landscape(packing), state)._compiled.share(0)
