"""The extreme in superellipsoid/harmonic: finite, as the bindings say, on any number of ranks.

A pair whose contact did not converge would stop LAMMPS.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from lammps_scenes import dump, load_plugin, run_lmp_well, states_from_dump
from superellipsoid_scenes import (
    crowd,
    difference_from_bindings,
    exponents_of,
    far_apart,
    loaded,
    scene,
    state_of,
    sums,
    tiny_box,
)

from jamshape import _contact
from jamshape.contacts import find_contacts

pytestmark = pytest.mark.lammps

# Relative to the largest force (torque); flat faces and sharp tips magnify rounding.
TOLERANCE = 1e-12

P = (0.55, 10.0)
AXES = {"w 0.1": [1.0, 1.0, 0.1], "w 10": [0.2, 0.2, 2.0], "w 0.1 and 10": [0.1, 1.0, 10.0]}
UPRIGHT = [1.0, 0.0, 0.0, 0.0]


def of_one_shape(p, axes):
    return crowd(kinds=(0,), n=16, phi=0.4, spread=0.0, shapes=([axes], [p]))


def of_all_shapes(dimension):
    axes = [axes for axes in AXES.values() for _ in P]
    kinds, exponents = range(len(axes)), len(AXES) * P
    return crowd(dimension, kinds, n=24, phi=0.5, shapes=(axes, exponents))


def aligned(p, distance, offset=0.0, tilt=0.0):
    """Two of semi-axes 1/2 along x."""
    beside = [distance, offset, 0.5 * offset, 1.0, 0.0, tilt, 0.5 * tilt]
    return [0.0, 0.0, 0.0, *UPRIGHT, 0.5, 0.5, 0.5, p], [*beside, 0.5, 0.5, 0.5, p]


def in_a_row(p, width):
    """On faces or tips of about this width: exactly, nearly, and off the middle."""
    cases = [(0.0, 0.0), (1e-9, 0.0), (0.0, 1e-9), (0.2, 0.0), (0.0, 0.1), (0.04, 0.06)]
    return far_apart([aligned(p, 0.98, *(width * np.array(case))) for case in cases])


def random_pairs(seed, n=12):
    rng = np.random.default_rng(seed)
    axes = list(AXES.values())[:2]
    turn = rng.normal(size=(2, n, 4))
    turn /= np.linalg.norm(turn, axis=2, keepdims=True)
    rows = np.zeros((2, n, 11))
    rows[1, :, :3] = rng.normal(size=(n, 3))
    rows[:, :, 3:7] = turn
    rows[:, :, 7:10] = [[axes[k % 2] for k in range(n)], [axes[k // 2 % 2] for k in range(n)]]
    rows[:, :, 10] = rng.choice(P, (2, n))
    return rows


def nearly_concentric():
    """From 1e-9 of the size to a tenth."""
    i, j = random_pairs(1)
    distance = np.logspace(-9, -1, len(j))
    j[:, :3] *= (distance / np.linalg.norm(j[:, :3], axis=1))[:, None]
    return far_apart(list(zip(i, j, strict=True)))


def overlapping_by_a_third():
    i, j = random_pairs(2)
    eta = _contact.superellipsoid_scales(i, j)["eta"]
    j[:, :3] *= (np.sqrt(2 / 3) / eta)[:, None]
    return far_apart(list(zip(i, j, strict=True)))


SCENES = {
    **{f"p {p} {w}": functools.partial(of_one_shape, p, AXES[w]) for p in P for w in AXES},
    "all shapes": functools.partial(of_all_shapes, 3),
    "plane, all shapes": functools.partial(of_all_shapes, 2),
    "cubes face to face": functools.partial(in_a_row, 10.0, 0.5),
    "octahedra tip to tip": functools.partial(in_a_row, 0.55, 0.01),
    "nearly concentric": nearly_concentric,
    "overlap of a third": overlapping_by_a_third,
    "own images": functools.partial(tiny_box, 3, (10.0, 0.55)),
    "plane, own images": functools.partial(tiny_box, 2, (10.0, 0.55)),
}


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
