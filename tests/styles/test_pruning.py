"""No contact of rods is missed by pruning of pairs, however they move; discs take a path of their own."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from lammps_runs import difference_from, difference_from_library, loaded, state_of
from lammps_scenes import dense, set_quaternion, turned
from scipy.spatial import cKDTree
from thinned import in_turn

from jamshape import contacts

pytestmark = pytest.mark.lammps


@pytest.mark.parametrize("dimension", [2, 3])
def test_discs_alone_take_the_same_path_to_rounding(dimension, tmp_path, measured):
    """A rod that touches nothing makes LAMMPS keep torques and quaternions of all."""
    discs = dense(dimension, alpha=0.0, n=24, phi=0.95 if dimension == 2 else 0.75)
    tree = cKDTree(discs.position - discs.box.lo, boxsize=discs.box.edges)
    trial = np.random.default_rng(1).uniform(0, discs.box.edges, (20000, dimension))
    distance, nearest = tree.query(trial, k=4)
    gap = (distance - discs.radius[nearest]).min(axis=1)
    rod_at, room = trial[gap.argmax()] + discs.box.lo, gap.max()
    assert room > 0
    rod = [room / 2, room / 4, room / 4]
    zero = {2: np.zeros(1), 3: [[1.0, 0, 0, 0]]}[dimension]
    with_rod = discs.with_(
        position=np.vstack([discs.position, rod_at]),
        orientation=np.concatenate([discs.orientation, zero]),
        diameters=np.vstack([discs.diameters, rod]),
        exponent=np.append(discs.exponent, 1.0),
        species=np.append(discs.species, 1),
        id=np.append(discs.id, discs.id.max() + 1),
        image=np.vstack([discs.image, np.zeros(dimension, int)]),
    )
    found = []
    for packing in (discs, with_rod):
        with loaded(packing, tmp_path) as session:
            session.commands("run 0")
            found.append((state_of(session), session.lmp.get_thermo("pe")))
    (alone, pe), (together, pe_together) = found
    assert np.abs(alone.force).max() > 1e-3
    assert not together.force[-1].any()
    assert not together.torque.any()
    assert not alone.torque.any()
    difference = np.abs(together.force[:-1] - alone.force).max() / np.abs(alone.force).max()
    measured(difference=difference)
    assert difference < 1e-15
    np.testing.assert_allclose(pe_together, pe, rtol=1e-14)


def set_poses(session, packing):
    """Under LAMMPS's feet; its lists are not made anew before it finds out by itself."""
    session.commands("\n".join(map(set_quaternion, packing.id, packing.quaternions)))
    order = np.searchsorted(packing.id, session.lmp.numpy.extract_atom("id")[: packing.n])
    x = session.lmp.numpy.extract_atom("x")[: packing.n]
    x[:, : packing.dimension] = packing.position[order]


class Flight:
    """Rods that fly and turn, each at a rate of its own; new rates for all where spines cross."""

    def __init__(self, packing, motion, seed):
        self.packing, self.motion = packing, motion
        self.rng = np.random.default_rng(seed)
        self.draw()

    def draw(self):
        n, dimension = self.packing.position.shape
        self.velocity = self.rng.normal(size=(n, dimension)) * (self.motion != "turn")
        spin = self.rng.normal(size=(n, 3)) * (self.motion != "shift")
        self.spin = (spin[:, 0] if dimension == 2 else spin) / self.packing.diameters[:, 0].mean()

    def go_on(self, length):
        for _ in range(100):
            position = self.packing.position + length * self.velocity
            moved_on = turned(self.packing.with_(position=position), length * self.spin)
            with suppress(ValueError):
                contacts.find_contacts(moved_on, sides=1)
                self.packing = moved_on
                return
            self.draw()
        raise AssertionError


@pytest.mark.parametrize(
    ("motion", "skin", "dimension"), in_turn(["turn", "shift", "both"], [0.05, 0.5, 4.0], [3, 2])
)
def test_no_contact_is_missed_however_rods_move(motion, skin, dimension, tmp_path, measured):
    """Steps of all sizes: the longest make LAMMPS rebuild its list, others only our shorter one."""
    start = dense(dimension, n=24, phi={2: 0.5, 3: 0.25}[dimension], seed=3, kick=0.0)
    flight = Flight(start.sorted_by_id(), motion, seed=dimension)
    largest, seen = 0.0, set()
    with loaded(flight.packing, tmp_path, skin=skin) as session:
        session.commands("run 0")
        for step in range(150):
            state = state_of(session)
            network = contacts.find_contacts(state.packing, sides=1)
            largest = max(largest, difference_from(network, state))
            seen |= set(map(tuple, network.pairs))
            flight.go_on([0.004, 0.012, 0.04][step % 3])
            set_poses(session, flight.packing)
            session.commands("run 1 pre no post no")
    measured(difference=largest, pairs=len(seen))
    assert len(seen) > 30
    assert largest < 1e-10


@pytest.mark.parametrize("dimension", [2, 3])
def test_no_contact_is_missed_while_the_box_shrinks(dimension, tmp_path, measured):
    """Long rods meet tip to tip by the motion of the substrate alone, without moving on it."""
    largest, n_new = 0.0, 0
    for seed in range(6):
        phi = {2: 0.4, 3: 0.15}[dimension]
        packing = dense(dimension, alpha=6.0, n=9, phi=phi, kick=0.0, seed=seed)
        before = contacts.find_contacts(packing, sides=1).pairs
        with loaded(packing, tmp_path, skin=4.0) as session:
            session.commands("""
                fix drive all overdamped/affine drag 1e6 compress 0.1
                timestep 0.01
                run 0""")
            for _ in range(25):
                session.commands("run 4 pre no post no")
                largest = max(largest, difference_from_library(state_of(session)))
            after = contacts.find_contacts(state_of(session).packing, sides=1).pairs
        n_new += len(set(map(tuple, after)) - set(map(tuple, before)))
    measured(difference=largest, new=n_new)
    assert n_new > 10
    assert largest < 1e-10
