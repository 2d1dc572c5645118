"""The stiff and the extreme in LAMMPS: finite, equal to the bindings, and no contact lost."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from extreme_rods import longer_than_the_box, stack
from lammps_runs import SIDES, difference_from_library, fix_vector, library_forces, loaded, state_of
from lammps_scenes import dense, rods, rods_3d, squeezed
from mixtures import bidisperse

from jamshape import contacts
from jamshape.protocols.random_start import random_packing

pytestmark = pytest.mark.lammps


# --- scenes --------------------------------------------------------------------------------------


def unequal(dimension, phi):
    start = random_packing(60, phi, 1, bidisperse(1.0, 10.0), dimension=dimension)
    return squeezed(start, 0.9)


SCENES = {
    "alpha 1e-6": lambda: dense(alpha=1e-6, n=32, phi=0.9),
    "alpha 1e-6, 3d": lambda: dense(3, alpha=1e-6, n=32, phi=0.7),
    "sizes 1 to 10": lambda: unequal(2, 0.45),
    "sizes 1 to 10, 3d": lambda: unequal(3, 0.2),
    "long rods in a small box": longer_than_the_box,
    "alpha 30": lambda: dense(alpha=30.0, n=8, phi=0.5, speed=0.005),
    **{f"stack to {a:.0e}": functools.partial(stack, a) for a in (1e-2, 1e-6, 1e-9, 1e-12, 0.0)},
    **{f"stack to {a:.0e}, 3d": functools.partial(stack, a, 3) for a in (1e-6, 1e-12, 0.0)},
}


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("name", SCENES)
def test_extreme_scenes_run_and_equal_the_bindings(name, sides, tmp_path, measured):
    packing = SCENES[name]()
    with loaded(packing, tmp_path, sides=sides) as session:
        session.commands("""
            fix drive all overdamped/affine drag 1.0 compress 1e-4
            timestep 0.02
            run 0""")
        before = state_of(session)
        session.commands("run 300")
        after = state_of(session)
    n_contacts = len(contacts.find_contacts(packing, sides=1).pairs)
    assert n_contacts > 3
    differences = [difference_from_library(state, sides) for state in (before, after)]
    measured(contacts=n_contacts, before=differences[0], after=differences[1])
    assert np.isfinite(after.force).all()
    assert np.isfinite(after.torque).all()
    assert max(differences) < 1e-12
    # The box shrinks by 0.06 %: what does not relax gains little.
    assert library_forces(after, sides).energy < 1.1 * library_forces(before, sides).energy


def test_scenes_hold_what_they_stand_for():
    network = contacts.find_contacts(longer_than_the_box(), sides=1)
    assert (network.pairs[:, 0] == network.pairs[:, 1]).sum() == 4
    sizes = SCENES["sizes 1 to 10"]().radius
    assert sizes.max() / sizes.min() == 10


# --- overlaps ------------------------------------------------------------------------------------


def pairs_with_overlaps(overlaps, dimension):
    """Far from each other, pairs of each class of contact at each overlap."""
    kinds = [  # angles of i and j, offset along i, distance of the axes over d
        (0.0, 1.0, 0.3, "tip on side"),
        (0.7, -0.6, None, "tip to tip"),
        (0.0, 0.0, 0.8, "side to side"),
        (0.0, 1e-12, 0.8, "nearly parallel"),
    ]
    position, angle, half_length, radius = [], [], [], []
    A, R = np.array([1.0, 0.6]), np.array([0.5, 0.3])
    side = 16.0
    for row, overlap in enumerate(overlaps):
        for column, (angle_i, angle_j, offset, _) in enumerate(kinds):
            centre = side * np.array([column, row])
            distance = (1 - overlap) * R.sum()
            u_j = np.array([np.cos(angle_j), np.sin(angle_j)])
            if offset is None:  # tip to tip, along a direction between both axes
                u_i = np.array([np.cos(angle_i), np.sin(angle_i)])
                shift = A[0] * u_i + distance * np.array([1.0, 0.0]) + A[1] * u_j
            elif angle_j > 0.5:
                shift = np.array([offset, distance]) + A[1] * u_j
            else:
                shift = np.array([offset, distance])
            position += [centre, centre + shift]
            angle += [angle_i, angle_j]
            half_length += list(A)
            radius += list(R)
    position = np.array(position) - side * np.array([len(kinds) - 1, len(overlaps) - 1]) / 2
    edges = side * np.array([len(kinds) + 1, len(overlaps) + 1])
    if dimension == 2:
        return rods(position, angle, half_length, radius, edges)
    half = np.array(angle) / 2
    q = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
    return rods_3d(np.pad(position, ((0, 0), (0, 1))), q, half_length, radius, [*edges, 16.0])


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("dimension", [2, 3])
def test_overlaps_from_rounding_to_a_third(dimension, sides, tmp_path, measured):
    overlaps = np.logspace(-14, np.log10(1 / 3), 12)
    packing = pairs_with_overlaps(overlaps, dimension)
    with loaded(packing, tmp_path, sides=sides) as session:
        session.commands("run 0")
        state = state_of(session)
    expected = library_forces(state, sides)
    size = np.linalg.norm(state.force, axis=1)
    # No boundary is crossed, so both see the same separations, and agree pair by pair.
    difference = np.abs(state.force - expected.force).max(axis=1)
    measured(difference=(difference / np.maximum(size, 1e-300)).max(), touching=(size > 0).sum())
    assert (difference <= 1e-14 * size).all()
    torque = np.abs(state.torque - expected.torque).reshape(packing.n, -1).max(axis=1)
    assert (torque <= 1e-14 * size).all()
    assert (size[packing.n // 12 :] > 0).all(), "only overlaps of 1e-14 may drown in rounding"
    assert contacts.find_contacts(packing, sides=1).kind.max() == 2
    for pair in range(0, packing.n, 2):
        np.testing.assert_allclose(state.force[pair], -state.force[pair + 1], rtol=1e-15)


# --- rates ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("kappa", [1e-3, 1e-5, 1e-7, 1e-10])
def test_rates(kappa, sides, tmp_path, measured):
    """The strain is right to its own last digits, though the box hardly changes."""
    packing, dt, steps = dense(n=24, phi=0.9), 0.1, 500
    with loaded(packing, tmp_path, sides=sides) as session:
        session.commands(f"""
            fix drive all overdamped/affine drag 1.0 compress {kappa}
            timestep {dt}
            run {steps}""")
        state, strain = state_of(session), fix_vector(session, "drive", 2)
    np.testing.assert_allclose(strain, kappa * dt * steps, rtol=1e-14)
    shrunk = state.packing.box.edges - packing.box.edges * np.exp(-kappa * dt * steps)
    assert np.abs(shrunk).max() <= 2 * np.spacing(packing.box.edges.max())
    difference = difference_from_library(state, sides)
    measured(difference=difference)
    assert difference < 1e-12
