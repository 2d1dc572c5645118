"""The words `atom_style ellipsoid superellipsoid` of LAMMPS from 2026 on: atoms with exponents of their own."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from lammps_runs import (
    Session,
    after_restart,
    error_of,
    load_plugin,
    refusal_of,
    run_lmp,
    run_lmp_well,
)
from lammps_scenes import dense
from superellipsoid_scenes import particles

import jamshape as js
from benchmarks.peer_contacts import compared, pairs_of
from jamshape.files.lammps_text import write_data
from jamshape.lammps.module import start_lammps
from jamshape.shapes.shape import Interaction


@functools.cache
def knows_the_word():
    lmp = start_lammps(["-screen", "none", "-log", "none"])
    try:
        return lmp.has_style("pair", "granular/superellipsoid")
    finally:
        lmp.close()


pytestmark = pytest.mark.lammps


@pytest.fixture(autouse=True)
def _with_the_word():
    if not knows_the_word():
        pytest.skip("this LAMMPS has no superellipsoids")


def bodies(dimension, exponent=(1.0, 2.0, 1.5), n=24, seed=1):
    """A crowd whose exponents LAMMPS can hold, none below 1: each is a type."""
    rng = np.random.default_rng(seed)
    edge = 4.0 if dimension == 2 else 2.6
    turn = rng.uniform(-3, 3, n) if dimension == 2 else rng.normal(size=(n, 4))
    axes = rng.uniform(0.35, 0.6, (n, 3))
    position = rng.uniform(-edge / 2, edge / 2, (n, dimension))
    return particles(position, turn, axes, np.resize(exponent, n), [edge] * dimension)


def start(packing, path, words, block=""):
    """Input up to the pair style, for a data file written here, with exponents if there are words."""
    style = packing.shape.style(packing, Interaction(1.0, 1))
    typed = packing.with_(species=style.types) if style.types is not None else packing
    write_data(path, typed, blocks=bool(words))
    return f"""
        units lj
        dimension {packing.dimension}
        boundary p p p
        atom_style ellipsoid {words}
        atom_modify map array
        read_data {path}
        {block}
        {style.commands}
        {after_restart()}"""


def forces_of(text):
    with Session() as session:
        session.commands(f"{text}\nrun 0")
        rows = session.lmp.numpy.extract_compute("state", 1, 2)  # per atom, an array
        return session.lmp.get_thermo("pe"), rows[np.argsort(rows[:, 0])]


def assert_same_bits(one, other):
    assert one[0] == other[0] > 0
    np.testing.assert_array_equal(*(rows for _, rows in (one, other)))


@pytest.mark.parametrize("dimension", [2, 3])
def test_superellipsoids_have_the_same_forces_with_the_word(dimension, tmp_path):
    packing = bodies(dimension)
    plain = forces_of(start(packing, tmp_path / "plain.data", ""))
    with_word = start(packing, tmp_path / "blocks.data", "superellipsoid")
    assert_same_bits(plain, forces_of(with_word))


def test_rods_have_the_same_forces_with_the_word(tmp_path):
    packing = dense(3)
    plain = forces_of(start(packing, tmp_path / "plain.data", ""))
    assert_same_bits(plain, forces_of(start(packing, tmp_path / "plain.data", "superellipsoid")))


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_compression_has_the_same_bits_with_the_word(ranks, tmp_path):
    packing = bodies(3, n=48)
    last = []
    for words in ("", "superellipsoid"):
        begin = start(packing, tmp_path / "s.data", words)
        run_lmp_well(
            f"""{load_plugin()}
            {begin}
            fix drive all overdamped/affine drag 1.0 compress 1e-2
            timestep 0.001
            run 50
            write_dump all custom {tmp_path}/{words}.dump id x y z c_state[9] c_state[10] modify sort id format float %.17g""",
            tmp_path,
            ranks,
        )
        last.append((tmp_path / f"{words}.dump").read_text())
    assert last[0] == last[1]
    assert len(last[0].splitlines()) == 9 + packing.n


def test_two_exponents_have_the_same_forces_with_the_word(tmp_path):
    packing = bodies(3, exponent=1.5)
    two = packing.with_(exponent=None, form=np.tile([4.0, 2.5], (packing.n, 1)))
    plain = forces_of(start(two, tmp_path / "plain.data", ""))
    with_word = start(two, tmp_path / "blocks.data", "superellipsoid")
    assert_same_bits(plain, forces_of(with_word))


@pytest.mark.parametrize("exponent", [(1.0, 2.0, 1.5), None], ids=["p", "n1 and n2"])
def test_data_files_written_by_lammps_are_read(exponent, tmp_path):
    packing = bodies(3, exponent or 1.5)
    if exponent is None:
        packing = packing.with_(exponent=None, form=np.tile([4.0, 2.5], (packing.n, 1)))
    with Session() as session:
        session.commands(start(packing, tmp_path / "ours.data", "superellipsoid"))
        session.commands(f"run 0\nwrite_data {tmp_path / 'theirs.data'}")
    ours, theirs = (
        js.load(tmp_path / f"{name}.data").sorted_by_id() for name in ("ours", "theirs")
    )
    assert theirs.shape_style == "superellipsoid"
    np.testing.assert_array_equal(theirs.form, ours.form)
    np.testing.assert_allclose(theirs.diameters, ours.diameters, rtol=1e-15)
    moved = (theirs.position - ours.position) / ours.box.edges
    np.testing.assert_allclose(moved, moved.round(), atol=1e-14)  # but for images


def test_exponents_that_differ_from_those_of_the_type_are_refused(tmp_path):
    packing = bodies(3, exponent=2.0)
    text = start(packing, tmp_path / "s.data", "superellipsoid", "set group all block 2 2")
    assert refusal_of(f"{text}\nrun 0") == (
        "pair_style superellipsoid/harmonic found atom 1 with the exponents 2 2, expected 4 4 of its type 1: give both "
        "the same, by 'set type 1 block 4 4' or by pair_coeff, or use 'atom_style ellipsoid' alone."
    )
    plain = forces_of(start(packing, tmp_path / "plain.data", ""))
    cured = text.replace("block 2 2", "block 2 2\nset type 1 block 4 4")
    assert_same_bits(plain, forces_of(cured))


def test_rods_with_exponents_are_refused(tmp_path):
    text = start(dense(3), tmp_path / "s.data", "superellipsoid", "set group all block 4 4")
    sentence = refusal_of(f"{text}\nrun 0")
    assert "found atom 1 with the exponents 4 4, expected 2 2 of its type" in sentence


def test_in_the_plane_only_the_exponent_of_the_plane_counts(tmp_path):
    packing = bodies(2, exponent=2.0)
    plain = forces_of(start(packing, tmp_path / "s.data", ""))
    other = start(packing, tmp_path / "s.data", "superellipsoid", "set type 1 block 7 4")
    assert_same_bits(plain, forces_of(other))


CREATED = """
    dimension 3
    atom_style ellipsoid superellipsoid
    create_random superellipsoid 20 0.2 1 type 1 1.0 1.2 1.4 form 2
    {more}
    pair_style superellipsoid/harmonic
    pair_coeff 1 1 1.0 2
    compute inertia all property/atom inertiax inertiay inertiaz mass
    dump d all custom 1 {folder}/created.dump c_inertia[*]
    run 0"""


def test_created_particles_need_their_exponents(tmp_path):
    text = f"{load_plugin()}\n{CREATED}"
    sentence = error_of(run_lmp(text.format(more="", folder=tmp_path), tmp_path))
    assert "with the exponents 2 2, expected 4 4 of its type 1" in sentence
    run_lmp_well(text.format(more="set type 1 block 4 4", folder=tmp_path), tmp_path)


def test_created_ellipsoids_have_the_inertia_of_their_mass(tmp_path):
    text = f"{load_plugin()}\n{CREATED}".replace(" form 2", "").replace("1.0 2\n", "1.0\n")
    run_lmp_well(text.format(more="", folder=tmp_path), tmp_path)
    rows = np.loadtxt(tmp_path / "created.dump", skiprows=9)
    squares = (np.array([1.0, 1.2, 1.4]) / 2) ** 2
    expected = (squares.sum() - squares) / 5  # m (b^2 + c^2) / 5
    np.testing.assert_allclose(rows[:, :3] / rows[:, 3:], np.tile(expected, (20, 1)), rtol=1e-5)


@pytest.mark.parametrize("exponents", [(2.0, 2.0), (3.0, 3.0), (8.0, 2.0)])
def test_contacts_are_those_of_lammps(exponents, measured):
    """If both bodies have the same exponents, in the same places and directions."""
    found = compared(pairs_of(200, np.array(exponents), seed=2))
    assert found["touching"] > 50
    assert found["differ"] == 0
    measured(angle=found["angle, largest"], arm=found["arm, largest"])
    assert found["angle, largest"] < 1e-9
    assert found["arm, largest"] < 1e-9
