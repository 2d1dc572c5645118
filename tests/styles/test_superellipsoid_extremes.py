"""The extreme in superellipsoid/harmonic: finite, as the bindings say, on any number of ranks.

A pair whose contact did not converge would stop LAMMPS.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from lammps_scenes import dump, load_plugin, run_lmp_well, states_from_dump
from superellipsoid_scenes import (
    SCENES,
    difference_from_bindings,
    exponents_of,
    loaded,
    scene,
    state_of,
    sums,
)

from jamshape.contacts import find_contacts

pytestmark = pytest.mark.lammps

# Relative to the largest force (torque); flat faces and sharp tips magnify rounding.
TOLERANCE = 1e-12


@functools.cache
def packing_of(name):
    return SCENES[name]()


def assert_is_as_expected(name, state, measured):
    expected = sums(packing_of(name))
    difference = difference_from_bindings(state)
    measured(difference=difference, bonds=expected["n_bonds"])
    assert expected["n_bonds"] >= 4
    assert np.isfinite(state.force).all()
    assert np.isfinite(state.torque).all()
    assert difference < TOLERANCE


@pytest.mark.parametrize("name", SCENES)
def test_forces_and_energy_equal_the_bindings(name, tmp_path, measured):
    packing = packing_of(name)
    with loaded(packing, tmp_path) as session:
        session.commands("run 0")
        state, energy = state_of(session, packing), session.lmp.get_thermo("pe")
    assert_is_as_expected(name, state, measured)
    np.testing.assert_allclose(energy, sums(packing)["energy"], rtol=1e-12)


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory):
    """States of all scenes, made in one process."""
    folder = tmp_path_factory.mktemp("ranks")
    label = {name: f"scene_{k}" for k, name in enumerate(SCENES)}
    decks = [
        f"""
        clear
        {load_plugin()}
        {scene(packing_of(name), folder / f"{label[name]}.data")}
        {dump(folder / f"{label[name]}.dump")}
        run 0"""
        for name in SCENES
    ]
    run_lmp_well("".join(decks), folder, ranks=2)
    return {
        name: states_from_dump(folder / f"{label[name]}.dump", exponents_of(packing_of(name)))[0]
        for name in SCENES
    }


@pytest.mark.parametrize("name", SCENES)
def test_forces_on_two_ranks_equal_the_bindings(name, on_two_ranks, measured):
    assert_is_as_expected(name, on_two_ranks[name], measured)


@pytest.mark.parametrize("name", ["plane, all shapes", "own images", "plane, own images"])
def test_forces_stay_right_in_motion(name, tmp_path, measured):
    """Found from the last normals, with lists made anew and kept."""
    packing = packing_of(name)
    with loaded(packing, tmp_path) as session:
        session.commands("""
            fix drive all overdamped/affine drag 1.0 compress 1e-4 integrator heun/adaptive tolerance 1e-3
            timestep 0.01
            run 20""")
        state, energy = state_of(session, packing), session.lmp.get_thermo("pe")
    difference = difference_from_bindings(state)
    measured(difference=difference, energy=energy / sums(packing)["energy"])
    assert difference < TOLERANCE
    assert 0 < energy < sums(packing)["energy"]


def test_scenes_hold_what_they_stand_for():
    bonds = find_contacts(packing_of("overlap of a third")).bonds
    np.testing.assert_allclose(1 - bonds.distance / bonds.reach, 1 / 3, rtol=1e-9)
    pairs = find_contacts(packing_of("own images")).pairs
    assert (pairs[:, 0] == pairs[:, 1]).any()
    for name in ("cubes face to face", "octahedra tip to tip", "nearly concentric"):
        assert sums(packing_of(name))["n_bonds"] == packing_of(name).n / 2
