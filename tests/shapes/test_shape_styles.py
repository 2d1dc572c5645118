"""The pair style of every shape in LAMMPS: the same forces, and all that LAMMPS does with them."""

import math
import warnings

import numpy as np
import pytest
from every_shape import (
    ALL,
    EPS,
    MIXTURES,
    ROUNDING,
    SIDES,
    TYPICAL,
    close_to,
    in_a_small_box,
    laws,
    pressed,
    scattered,
    squeezed,
)
from in_lammps import fix_value, forces_of, holding, law_of, on_ranks, vector_of

from jamshape.contacts import coordination, find_contacts, forces, sum_forces
from jamshape.files.lammps_text import read_data, read_dump, write_data
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.measures.minimum import order

pytestmark = pytest.mark.lammps

SCENES = {
    **{str(case): (pressed, case) for case in ALL},
    **{f"{case}-small": (in_a_small_box, case) for case in (*TYPICAL, *MIXTURES)},
}


def made(name):
    make, case = SCENES[name]
    return with_odd_ids(make(case))


def numbered(packing):
    """As LAMMPS numbers them, from 1."""
    return packing.with_(id=1 + np.argsort(np.argsort(packing.id)))


def with_odd_ids(packing, seed=3):
    """Shuffled, with gaps."""
    ids = 1 + np.random.default_rng(seed).permutation(3 * packing.n)[: packing.n]
    return packing.with_(id=ids)


def assert_same_forces(packing, law, found, measured):
    """Energy, pressure, forces and torques in the order of the IDs are those of the library."""
    energy, pressure, force, torque = found
    network = find_contacts(packing, law.k_e, law.sides)
    expected, order_of_ids = sum_forces(packing, network), np.argsort(packing.id)
    largest = np.abs(network.force).max()
    torques = max(np.abs([network.torque_i, network.torque_j]).max(), largest)
    off = np.abs(force - expected.force[order_of_ids]).max() / largest
    off_torque = np.abs(torque - expected.torque[order_of_ids]).max() / torques
    measured(force=off, torque=off_torque)
    # Coordinates are rounded to EPS of the box, forces by that over the overlap.
    overlap = 1 - network.bonds.distance / network.bonds.reach
    limit = max(ROUNDING, 8 * EPS * packing.box.edges.max() / overlap.max())
    assert off <= limit
    assert off_torque <= limit
    assert energy == close_to(expected.energy, ROUNDING)
    assert pressure == close_to(expected.pressure, ROUNDING)
    assert len(network.pairs) >= 3


# In a process of their own; each scene takes a while to start there.
ON_TWO_RANKS = {
    f"{case}{size}": newton
    for case in MIXTURES
    for size, newton in (("", "on" if case.dimension == 2 else "off"), ("-small", "off"))
}


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("name", SCENES)
def test_forces_are_those_of_the_library(name, newton, measured):
    packing = made(name)
    for law in map(law_of, laws(packing)):
        with holding(packing, law, newton) as session:
            session.commands("run 0")
            thermo = [session.lmp.get_thermo(key) for key in ("pe", "press", "pxx", "pyy", "pxy")]
            force, torque = forces_of(session)
        assert_same_forces(packing, law, (*thermo[:2], force, torque), measured)
        virial = forces(packing, law.k_e, law.sides).virial / packing.box.volume
        stress = [virial[0, 0], virial[1, 1], virial[0, 1]]
        np.testing.assert_allclose(thermo[2:], stress, 0, ROUNDING * np.abs(virial).max())


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory):
    """Scenes with newton on and off, all in one process."""
    inputs = {name: (made(name), law_of(SIDES), newton) for name, newton in ON_TWO_RANKS.items()}
    return inputs, on_ranks(inputs, tmp_path_factory.mktemp("ranks"))


@pytest.mark.parametrize("name", ON_TWO_RANKS)
def test_forces_on_two_ranks_are_those_of_the_library(name, on_two_ranks, measured):
    inputs, found = on_two_ranks
    packing, law, _ = inputs[name]
    assert_same_forces(packing, law, found[name], measured)


# --- computes ------------------------------------------------------------------------------------

BONDS = "itag jtag kind bond dist sumrad overlap fx fy fz nx ny nz cx cy cz energy sidei sidej"


def expected_rows(packing, network):
    """Columns of BONDS, the particle with the smaller ID first."""
    bonds = network.bonds
    tags = packing.id[network.pairs[bonds.contact]]
    swap = tags[:, 0] > tags[:, 1]
    sign = np.where(swap, -1.0, 1.0)[:, None]
    tags = np.where(swap[:, None], tags[:, ::-1], tags)
    sides = np.where(swap[:, None], bonds.on_side[:, ::-1], bonds.on_side)
    number = np.arange(len(tags)) - np.searchsorted(bonds.contact, bonds.contact)
    return np.column_stack([
        tags, network.kind[bonds.contact], number, bonds.distance, bonds.reach,
        1 - bonds.distance / bonds.reach, three(sign * bonds.force), three(sign * bonds.normal),
        three(bonds.point), bonds.energy, sides,
    ])  # fmt: skip


def three(vectors):
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def comparable(rows, packing):
    """Rows with points on circles round the periodic box, without what is a matter of choice."""
    rows = rows.copy()
    own = rows[:, 0] == rows[:, 1]  # which of two images is i; and with it the side, and the number
    flip = own & (rows[np.arange(len(rows)), 10 + np.abs(rows[:, 10:13]).argmax(axis=1)] < 0)
    rows[flip, 7:13] *= -1
    rows[own, 17:] = np.sort(rows[own, 17:], axis=1)
    rows[:, 3] = 0
    D = packing.dimension
    angle = 2 * np.pi * rows[:, 13 : 13 + D] / packing.box.edges
    return np.column_stack([rows[:, :13], np.cos(angle), np.sin(angle), rows[:, 16:]])


def assert_same_rows(found, expected):
    """In any order."""
    assert found.shape == expected.shape
    apart = np.abs(found[:, None] - expected).max(axis=2)
    nearest = apart.argmin(axis=1)
    assert sorted(nearest) == list(range(len(expected)))
    assert apart.min(axis=1).max() < 1e-12


@pytest.mark.parametrize("name", SCENES)
def test_rows_of_contact_local_are_the_bonds_of_the_library(name):
    packing = made(name)
    law = law_of(SIDES)
    with holding(packing, law) as session:
        session.commands(f"compute bonds all contact/local {BONDS}\nrun 0")
        style_local, array = 2, 2
        found = session.lmp.numpy.extract_compute("bonds", style_local, array).copy()
    found = found.reshape(-1, len(BONDS.split()))
    network = find_contacts(packing, law.k_e, law.sides)
    expected = expected_rows(numbered(packing), network)
    assert_same_rows(comparable(found, packing), comparable(expected, packing))
    assert set(found[:, 3]) == set(expected[:, 3]) == set(range(network.n_bonds.max()))


@pytest.mark.parametrize("case", ALL, ids=str)
@pytest.mark.parametrize("overlap", [0.002, 0.1])
def test_compute_packing_is_what_the_library_measures(case, overlap, measured):
    packing, law = squeezed(case, overlap=overlap), law_of(SIDES)
    with holding(packing, law) as session:
        session.commands("run 0")
        found = vector_of(session, "packing")
    network = find_contacts(packing, law.k_e, law.sides)
    sums, counted = sum_forces(packing, network), coordination(packing, network)
    bond_force = np.linalg.norm(network.bonds.force, axis=1).mean()
    net = np.linalg.norm(sums.force, axis=1) / bond_force
    torque = np.linalg.norm(sums.torque.reshape(packing.n, -1), axis=1)
    gyration = np.sqrt(packing.compiled().moment.max(axis=1))
    deepest = (1 - network.bonds.distance / network.bonds.reach).max()
    expected = {
        1: packing.phi, 2: sums.energy / packing.box.volume, 3: sums.pressure, 4: counted.z,
        7: net.max(), 8: np.sqrt((net**2).mean()), 9: counted.z_single, 10: counted.n_rattlers,
        12: deepest, 13: (torque / gyration).max() / bond_force,
    }  # fmt: skip
    measured(z=counted.z, rattlers=counted.n_rattlers)
    largest = np.abs(network.force).max() / bond_force
    for element, value in expected.items():
        size = max(abs(value), largest if element in (7, 8, 13) else 0.0)
        assert found[element - 1] == pytest.approx(value, rel=0, abs=10 * ROUNDING * size), element


@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_order_is_that_of_the_library(case):
    packing = squeezed(case)
    with holding(packing, law_of(SIDES)) as session:
        session.commands("run 0")
        found = vector_of(session, "packing")
    expected = order(packing)
    at = {"S2": 4, "S4": 5, "C4": 13}
    for name, value in expected.items():
        if not (name == "C4" and found[13] == 0.0):  # of shapes for which it is not defined
            assert found[at[name]] == close_to(value, 1e-11), name


# --- moving --------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
def test_cg_relaxes_positions_and_orientations(case, measured):
    packing, law = pressed(case), law_of(SIDES)
    start, before = (forces(p, law.k_e, law.sides).energy for p in (squeezed(case), packing))
    with holding(packing, law) as session:
        session.commands("""
            min_style cg
            min_modify dmax 0.05
            minimize 0.0 0.0 300 6000
            run 0""")
        after, end = session.lmp.get_thermo("pe"), session.packing()
    turned = np.abs(end.axes - packing.axes).max()
    measured(left=(after - start) / (before - start), turned=turned)
    # What the kick off the minimum cost is taken back.
    assert before > 1.02 * start
    assert after - start < 0.1 * (before - start)
    assert turned > 1e-3
    assert after == close_to(forces(end, law.k_e, law.sides).energy, 1e-11)


@pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
def test_no_contact_is_missed_while_a_dilute_packing_becomes_dense(case, measured):
    packing, law = scattered(case), law_of(SIDES)
    strain = math.log(0.8 / packing.phi) / packing.dimension
    worst = 0.0
    with holding(packing, law) as session:
        session.commands(f"""
            fix flow all overdamped/affine drag 1.0 compress {strain / 20!r} integrator rkc2
            timestep 1.0
            run 0""")
        for _ in range(10):
            session.commands("run 2 pre no post no")
            now = session.packing()
            network = find_contacts(now, law.k_e, law.sides)
            if len(network.pairs):
                off = forces_of(session)[0] - sum_forces(now, network).force
                worst = max(worst, np.abs(off).max() / np.abs(network.force).max())
        rebuilds = fix_value(session, "flow", 7)
    measured(off=worst, rebuilds=rebuilds, phi=now.phi)
    assert len(network.pairs) >= packing.n
    assert rebuilds > 0
    # Angles of the plane are taken from quaternions, to a rounding of their own.
    assert worst < 100 * ROUNDING


# --- files ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
def test_a_restart_goes_on_to_the_last_bit(case, tmp_path):
    packing = squeezed(case, overlap=0.002)
    settings = Compression(kappa=1e-3, phi_end=1.02 * packing.phi, dt=0.1, sides=SIDES,
                           integrator="rkc2")  # fmt: skip
    path, ends = tmp_path / "half", []
    with Session() as session:
        run = CompressionRun(session, settings, packing)
        half = run.last_step // 2
        run.advance(half)
        run.write_restart(path)
        middle = run.packing()
        run.advance(run.last_step)
        ends.append((run.packing(), run.measure()))
    with Session() as session:
        run = CompressionRun(session, settings, packing, restart=path)
        assert session.step == half > 3
        assert_same_bits(run.packing(), middle)
        run.advance(run.last_step)
        ends.append((run.packing(), run.measure()))
    (one, measured_one), (other, measured_other) = ends
    assert_same_bits(one, other)
    for name in ("phi", "u", "pressure", "z", "fmax", "strain"):
        assert measured_one[name] == measured_other[name], name
    assert np.abs(one.position - middle.position).max() > 1e-6


def assert_same_bits(one, other):
    for name in ("position", "orientation", "diameters", "exponent", "species", "id", "step"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for name in ("lo", "edges"):
        np.testing.assert_array_equal(getattr(one.box, name), getattr(other.box, name))


@pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
def test_data_files_and_dumps_come_back(case, tmp_path):
    packing = with_odd_ids(pressed(case))
    ours, theirs, dump = (tmp_path / name for name in ("ours", "theirs", "dump"))
    write_data(ours, packing)
    columns = "id type x y z ix iy iz quatw quati quatj quatk shapex shapey shapez"
    with holding(packing, law_of(SIDES)) as session:
        session.commands(f"""
            compute poses all property/atom {columns}
            dump poses all custom 1 {dump} c_poses[*]
            dump_modify poses format float %.17g
            run 0
            write_data {theirs}""")
    text = dump.read_text()
    assert "c_poses[1] c_poses[2]" in text
    dump.write_text(text.replace(" ".join(f"c_poses[{k}]" for k in range(1, 16)), columns))
    types = packing.shape.style(packing, law_of(SIDES)).types
    in_lammps = numbered(packing).with_(species=types)
    assert_same_packing(read_data(ours), packing)
    name, dimension = packing.shape_style, packing.dimension
    with warnings.catch_warnings(action="ignore"):  # exponents, which LAMMPS does not write
        theirs, last = read_data(theirs, dimension, name), read_dump(dump, dimension, name)[-1]
    assert_same_packing(theirs, in_lammps)
    assert_same_packing(last, in_lammps)


def assert_same_packing(found, written):
    """Poses and sizes to rounding, and the same energy once exponents, which LAMMPS does not write, are told."""
    expected = written.sorted_by_id()
    np.testing.assert_array_equal(found.id, expected.id)
    np.testing.assert_array_equal(found.species, expected.species)
    place, there = (x.position + x.image * x.box.edges for x in (found, expected))
    np.testing.assert_allclose(place, there, rtol=0, atol=8 * EPS * np.abs(there).max())
    np.testing.assert_allclose(found.axes, expected.axes, rtol=0, atol=8 * EPS)
    np.testing.assert_allclose(found.diameters, expected.diameters, rtol=8 * EPS)
    np.testing.assert_allclose(found.box.edges, expected.box.edges, rtol=8 * EPS)
    assert found.shape_style == written.shape_style
    told = found.with_(exponent=expected.exponent)
    energy = forces(expected, 1.0, SIDES).energy
    assert forces(told, 1.0, SIDES).energy == close_to(energy, 1e-12)
