"""Forces, torques, energy and pressure in LAMMPS against the bindings and against differences."""

from __future__ import annotations

import functools
from contextlib import suppress

import numpy as np
import pytest
from lammps_scenes import (
    SIDES,
    after_box,
    angle_between,
    before_box,
    bindings_forces,
    dense,
    dense_mixture,
    difference_from,
    difference_from_bindings,
    dump,
    fix_vector,
    global_vector,
    gradient_by_differences,
    kicked,
    load_plugin,
    loaded,
    moved,
    on_grid,
    pose_differences,
    rods,
    rods_3d,
    run_lmp_well,
    set_quaternion,
    state_of,
    states_from_dump,
    tiny_box,
    turned,
    with_odd_ids,
)
from scipy.spatial import cKDTree

from jamshape import contacts
from jamshape.files.lammps_text import write_data

pytestmark = pytest.mark.lammps

# Relative to the largest force (torque) of the packing.
TOLERANCE = 1e-14


THERMO = """
    compute packing all packing
    thermo_style custom step pe press c_packing[1] c_packing[2] c_packing[3]
    thermo_modify norm no format float %.17g"""

# --- scenes --------------------------------------------------------------------------------------


def lone_rod():
    """A rod tip to tip with its own image, and side to side with the next row's."""
    return rods([[0.1, 0.2]], 0.01, 1.0, 0.5, [2.9, 0.9375])


def tiny_box_3d():
    quaternion = [[1.0, 0.0, 0.02, 0.0], [1.0, 0.03, 0.0, 0.01]]
    return rods_3d([[0, 0, 0], [0.25, 1.0, 0.1]], quaternion, 1.5, [0.6, 0.5], [4.0, 2.0, 1.0625])


SCENES = {
    "rods": dense,
    "mixture": dense_mixture,
    "nearly discs": lambda: dense(alpha=0.01, phi=1.0),
    "discs": lambda: dense(alpha=0.0, phi=1.0),
    "odd ids": lambda: with_odd_ids(dense(), 5),
    "shifted": lambda: on_grid(moved(dense(), [0.37, 0.61])),
    "tiny box": tiny_box,
    "lone rod": lone_rod,
    "rods 3d": lambda: dense(3, alpha=3.0, phi=0.8),
    "mixture 3d": lambda: dense_mixture(3, phi=0.8),
    "spheres": lambda: dense(3, alpha=0.0, phi=0.85),
    "tiny box 3d": tiny_box_3d,
}
CASES = [
    (name, sides, newton)
    for name in SCENES
    for sides in SIDES
    for newton in ("on", "off")
]  # fmt: skip


@functools.cache
def packing_of(name):
    return SCENES[name]()


def assert_energy_and_pressure(packing, expected, *, pe, press, phi, u, p):
    assert expected.energy > 0
    np.testing.assert_allclose(pe, expected.energy, rtol=TOLERANCE)
    np.testing.assert_allclose(press, expected.pressure, rtol=TOLERANCE)
    np.testing.assert_allclose(u, expected.energy / packing.box.volume, rtol=TOLERANCE)
    np.testing.assert_allclose(p, expected.pressure, rtol=TOLERANCE)
    np.testing.assert_allclose(phi, packing.phi, rtol=TOLERANCE)


@pytest.mark.parametrize(("name", "sides", "newton"), CASES)
def test_forces_equal_the_bindings(name, sides, newton, tmp_path, measured):
    packing = packing_of(name)
    with loaded(packing, tmp_path, sides=sides, newton=newton) as session:
        session.commands(f"{THERMO}\nrun 0")
        state = state_of(session)
        thermo = {key: session.lmp.get_thermo(key) for key in ("pe", "press")}
        phi, u, p = global_vector(session, "packing")[:3]
    difference = difference_from_bindings(state, sides)
    measured(difference=difference)
    assert difference < TOLERANCE
    expected = bindings_forces(state, sides)
    assert_energy_and_pressure(packing, expected, **thermo, phi=phi, u=u, p=p)


# --- two ranks: all scenes in one process --------------------------------------------------------


def one_scene(case, folder):
    name, sides, newton = case
    label = "-".join(case).replace(" ", "_")
    write_data(folder / f"{label}.data", packing_of(name))
    return f"""
        clear
        {load_plugin()}
        {before_box(packing_of(name).dimension, newton)}
        read_data {label}.data
        {after_box(sides)}
        {THERMO}
        {dump(f"{label}.dump")}
        run 0
        print "{label} $(pe:%.17g) $(press:%.17g) $(c_packing[1]:%.17g) $(c_packing[2]:%.17g) &
            $(c_packing[3]:%.17g)" append thermo"""


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory):
    """State and thermo output of every case."""
    folder = tmp_path_factory.mktemp("ranks")
    run_lmp_well("".join(one_scene(case, folder) for case in CASES), folder, ranks=2)
    rows = [line.split() for line in (folder / "thermo").read_text().splitlines()]
    thermo = {label: [float(number) for number in numbers] for label, *numbers in rows}
    return {
        case: (states_from_dump(folder / f"{label}.dump")[0], thermo[label])
        for case in CASES
        for label in ["-".join(case).replace(" ", "_")]
    }


@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_forces_on_two_ranks_equal_the_bindings(case, on_two_ranks, measured):
    name, sides, _ = case
    state, (pe, press, phi, u, p) = on_two_ranks[case]
    difference = difference_from_bindings(state, sides)
    measured(difference=difference)
    assert difference < TOLERANCE
    expected = bindings_forces(state, sides)
    assert_energy_and_pressure(packing_of(name), expected, pe=pe, press=press, phi=phi, u=u, p=p)


# --- what the scenes hold, and what forces must not depend on ------------------------------------


def test_scenes_hold_what_they_stand_for():
    kinds = contacts.find_contacts(dense(), sides=2).kind
    assert set(kinds) == {0, 1, 2}
    for name in ("tiny box", "tiny box 3d"):
        network = contacts.find_contacts(packing_of(name), sides=1)
        i, j = network.pairs.T
        assert (i == j).any(), "own image in reach"
        assert ((i == 0) & (j == 1)).sum() > 1, "several images of the neighbour in reach"
    lone = contacts.find_contacts(packing_of("lone rod"), sides=2)
    assert set(lone.kind) == {0, 2}


@pytest.mark.parametrize("sides", SIDES)
def test_forces_do_not_depend_on_ids_or_origin(sides, on_two_ranks):
    def sorted_forces(name):
        state, _ = on_two_ranks[name, sides, "on"]
        rank = np.argsort(packing_of(name).id)  # rows of the packing in the order of the IDs
        force, torque = np.empty_like(state.force), np.empty_like(state.torque)
        force[rank], torque[rank] = state.force, state.torque
        return force, torque

    force, torque = sorted_forces("rods")
    for name in ("odd ids", "shifted"):
        other_force, other_torque = sorted_forces(name)
        np.testing.assert_allclose(other_force, force, rtol=0, atol=1e-14 * np.abs(force).max())
        np.testing.assert_allclose(other_torque, torque, rtol=0, atol=1e-14 * np.abs(torque).max())


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


# --- the gradient of the energy ------------------------------------------------------------------


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("name", ["rods", "mixture", "rods 3d"])
def test_forces_are_the_gradient_of_the_energy(name, sides, tmp_path, measured):
    packing = packing_of(name)
    with loaded(packing, tmp_path, sides=sides, extra="atom_modify sort 0 0.0") as session:
        session.commands("run 0")
        state = state_of(session)
        by_position, by_rotation = gradient_by_differences(session, state, 1e-6)
        np.testing.assert_array_equal(state_of(session).packing.position, packing.position)
    of_force = np.abs(by_position + state.force).max() / np.abs(state.force).max()
    of_torque = np.abs(by_rotation + state.torque).max() / np.abs(state.torque).max()
    measured(force=of_force, torque=of_torque)
    assert of_force < 1e-7
    assert of_torque < 1e-7


# --- pruning of pairs ----------------------------------------------------------------------------


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


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("skin", [0.05, 0.5, 4.0])
@pytest.mark.parametrize("motion", ["turn", "shift", "both"])
def test_no_contact_is_missed_however_rods_move(motion, skin, dimension, tmp_path, measured):
    """Steps of all sizes: the longest make LAMMPS rebuild its list, others only our shorter one."""
    start = dense(dimension, n=24, phi={2: 0.5, 3: 0.25}[dimension], seed=3, kick=0.0)
    flight = Flight(start.sorted_by_id(), motion, seed=dimension)
    largest, seen = 0.0, set()
    with loaded(flight.packing, tmp_path, skin=skin) as session:
        session.commands("run 0")
        for step in range(150):
            state = state_of(session)
            network = contacts.find_contacts(state.exact, sides=1)
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
                largest = max(largest, difference_from_bindings(state_of(session)))
            after = contacts.find_contacts(state_of(session).packing, sides=1).pairs
        n_new += len(set(map(tuple, after)) - set(map(tuple, before)))
    measured(difference=largest, new=n_new)
    assert n_new > 10
    assert largest < 1e-10


@pytest.mark.parametrize("name", ["rods", "mixture", "rods 3d"])
def test_skin_changes_nothing_in_a_run(name, tmp_path, measured):
    """Violent relaxation: torques are large, rods turn fast."""
    packing = kicked(packing_of(name), 0.2, 4)
    found, rebuilds = {}, {}
    for skin in (0.05, 4.0):
        with loaded(packing, tmp_path, sides="two", skin=skin) as session:
            session.commands("""
                fix compress all overdamped/affine drag 0.1 compress -0.05
                timestep 0.005
                run 400""")
            found[skin] = state_of(session)
            rebuilds[skin] = fix_vector(session, "compress", 7)
    turned_by = angle_between(found[0.05].quaternion, packing.sorted_by_id().quaternions)
    distance, angle = pose_differences(found[0.05], found[4.0])
    forces = max(difference_from_bindings(state, "two") for state in found.values())
    measured(distance=distance, angle=angle, forces=forces, rebuilds=rebuilds[0.05],
             turned=turned_by.max())  # fmt: skip
    assert turned_by.max() > 0.1
    assert rebuilds[0.05] > 10 * max(rebuilds[4.0], 0.5)
    assert distance < 1e-12
    assert angle < 1e-12
    assert forces < 1e-13  # positions are off the grid now: periodic images are rounded
