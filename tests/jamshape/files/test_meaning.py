"""Data files and dumps of others: dimension, shape and law are said, or guessed with a warning."""

import gzip
import re

import numpy as np
import pytest
from dumps import read_dump
from lammps_runs import run_lmp_well

import jamshape as js
from jamshape.contacts import find_contacts
from jamshape.files.h5md import FileFormatError
from jamshape.files.lammps_text import read_data, write_data
from jamshape.packing import Box, Packing
from jamshape.shapes.shape import Interaction
from jamshape.shapes.table import SHAPES

RODS = "spherocylinder"
PHI = 2 * (np.pi / 4 + 4) / 400  # of PLAIN
PLAIN = """LAMMPS data file

2 atoms
1 atom types
2 ellipsoids

0 20 xlo xhi
0 20 ylo yhi
-0.5 0.5 zlo zhi

Atoms # ellipsoid

1 1 1 1.0 10.0 10.0 0.0
2 1 1 1.0 10.5 10.8 0.0

Ellipsoids

1 5 1 1 1 0 0 0
2 5 1 1 1 0 0 0
"""
ATOMS = "1 1 1 1.0 10.0 10.0 0.0\n2 1 1 1.0 10.5 10.8 0.0"
NO_SHAPE = "does not state the shape of its particles: they are read as spherocylinders in {}D"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state"


def changed(*changes):
    text = PLAIN
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


ELLIPSOIDS = "Ellipsoids\n\n1 5 1 1 1 0 0 0\n2 5 1 1 1 0 0 0\n"

SAME = {
    "as it is": [],
    "comments": [("2 atoms", "2 atoms   # all"), ("10.0 0.0\n", "10.0 0.0 # a rod\n")],
    "other ends of lines": [("\n", "\r\n")],
    "exponents": [("10.0 10.0", "1.0e1 1.0E+01")],
    "another count": [("1 atom types", "1 atom types\n5 extra bond per atom")],
    "images": [("10.0 0.0\n", "10.0 0.0 0 0 0\n"), ("10.8 0.0\n", "10.8 0.0 1 0 0\n")],
    "masses": [("Atoms", "Masses\n\n1 1.0\n\nAtoms")],
    "order": [(f"\n{ELLIPSOIDS}", ""), ("Atoms", f"{ELLIPSOIDS}\nAtoms")],
    "a long quaternion": [("1 1 1 0 0 0", "1 1 2 0 0 0")],
    "tabs": [("1 1 1 1.0 10.0", "1 1 1\t1.0\t10.0")],
    "no tilt": [("zlo zhi", "zlo zhi\n0 0 0 xy xz yz")],
    "labels": [("Atoms", "Atom Type Labels\n\n1 rod\n\nAtoms")],
    "labels in rows": [
        ("Atoms", "Atom Type Labels\n\n1 rod\n\nAtoms"),
        ("\n1 1 1 1.0", "\n1 rod 1 1.0"),
        ("\n2 1 1 1.0", "\n2 rod 1 1.0"),
    ],
    "velocities": [("Ellipsoids\n", "Velocities\n\n1 0 0 0 0 0 0\n2 0 0 0 0 0 0\n\nEllipsoids\n")],
    "no title": [("Atoms # ellipsoid", "Atoms")],
    "a hybrid": [
        ("# ellipsoid", "# hybrid ellipsoid molecular"),
        (ATOMS, "1 1 10.0 10.0 0.0 1 1.0 7\n2 1 10.5 10.8 0.0 1 1.0 7"),
    ],
    "a hybrid with images": [
        ("# ellipsoid", "# hybrid ellipsoid charge"),
        (ATOMS, "1 1 10.0 10.0 0.0 1 1.0 0.5 0 0 0\n2 1 10.5 10.8 0.0 1 1.0 0.5 1 0 0"),
    ],
}


@pytest.mark.parametrize("changes", SAME.values(), ids=SAME.keys())
def test_a_data_file_of_rods(path, changes):
    path.write_text(changed(*changes))
    with pytest.warns(UserWarning, match=NO_SHAPE.format(2)) as said:
        guessed = js.load(path)
    assert len(said) == 1
    for packing in (guessed, js.load(path, shape=RODS)):
        assert (packing.dimension, packing.shape_style) == (2, RODS)
        np.testing.assert_array_equal(packing.position, [[10, 10], [10.5, 10.8]])
        np.testing.assert_array_equal(packing.orientation, 0)
        assert packing.phi == pytest.approx(PHI, rel=1e-14) == pytest.approx(0.0239270, abs=5e-8)


def test_the_pair_style_of_a_file_says_shape_law_and_exponents(path):
    path.write_text(changed(("Atoms", "Pair Coeffs # spherocylinder/harmonic\n\n1 2.5\n\nAtoms")))
    packing = js.load(path)
    assert (packing.shape_style, packing.law) == (RODS, Interaction(2.5, 2))
    path.write_text(
        changed(("Atoms", "PairIJ Coeffs # superellipsoid/harmonic\n\n1 1 2 1.5\n\nAtoms"))
    )
    packing = js.load(path)
    assert (packing.shape_style, packing.law.k_e) == ("superellipsoid", 2)
    np.testing.assert_array_equal(packing.exponent, 1.5)
    two = "Pair Coeffs # dimer/harmonic\n\n1 1\n2 3\n\nAtoms"
    path.write_text(changed(("Atoms", two), ("1 atom types", "2 atom types")))
    with pytest.warns(UserWarning, match="k_e of equal types only.*write_data FILE pair ij"):
        packing = js.load(path)
    assert packing.law.k_e == ((1.0, 3**0.5), (3**0.5, 3.0))  # as LAMMPS mixes
    three = "PairIJ Coeffs # dimer/harmonic\n\n1 1 1\n1 2 7\n2 2 3\n\nAtoms"
    path.write_text(changed(("Atoms", three), ("1 atom types", "2 atom types")))
    assert js.load(path).law.k_e == ((1.0, 7.0), (7.0, 3.0))
    path.write_text(
        changed(("Atoms", three.replace("1 2 7\n", "")), ("1 atom types", "2 atom types"))
    )
    with pytest.raises(FileFormatError, match="coefficients have 2 rows for 2 types, expected 3"):
        js.load(path)


REFUSED = {
    "hybrid": (
        [("# ellipsoid", "# hybrid"), (ATOMS, "1 1 10 10 0 1 1.0\n2 1 10.5 10.8 0 1 1.0")],
        "titled 'Atoms # hybrid', which does not define its 7 columns",
    ),
    "images of a hybrid": (
        [
            ("# ellipsoid", "# hybrid"),
            (ATOMS, "1 1 4 4 0 1 1 0 0 0\n2 1 12 9 0 1 1 0 0 0"),
        ],
        "titled 'Atoms # hybrid', which does not define its 10 columns",
    ),
    "another one first": (
        [
            ("# ellipsoid", "# hybrid molecular ellipsoid"),
            (ATOMS, "1 1 10.0 10.0 0.0 1 1 1.0\n2 1 10.5 10.8 0.0 2 1 1.0"),
        ],
        "titled 'Atoms # hybrid molecular ellipsoid', which does not define its 8 columns",
    ),
    "another style": (
        [("# ellipsoid", "# atomic")],
        "titled 'Atoms # atomic', expected atoms of style ellipsoid or sphere",
    ),
    "columns of a hybrid without a title": (
        [("Atoms # ellipsoid", "Atoms"), (ATOMS, "1 1 10 10 0 1 1.0\n2 1 10.5 10.8 0 1 1.0")],
        "columns of Atoms are not those of atom_style ellipsoid, expected 1 as ellipsoidflag",
    ),
    "blocks that are not convex": (
        [("1 0 0 0\n", "1 0 0 0 2.0 0.9\n")],
        "exponents hold 0.9, expected n1 and n2 > 1, for which bodies are convex",
    ),
    "blocks that are not positive": (
        [("1 0 0 0\n", "1 0 0 0 2.0 0.0\n")],
        "block1 or block2 is not positive, expected n1 and n2 of each particle",
    ),
    "a point": (
        [("2 ellipsoids", "1 ellipsoids"), ("\n2 5 1 1 1 0 0 0\n", "\n")],
        "section Ellipsoids has 1 rows for 2 atoms",
    ),
    "nothing": ([(PLAIN, "")], "is empty, expected"),
}


@pytest.mark.parametrize(("changes", "sentence"), REFUSED.values(), ids=REFUSED.keys())
def test_a_data_file_that_is_refused(path, changes, sentence):
    path.write_text(changed(*changes))
    with pytest.raises(FileFormatError, match=re.escape(sentence)) as refused:
        js.load(path)
    assert str(path) in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_files_of_other_formats_are_named(path):
    path.write_bytes(gzip.compress(b"notes"))
    with pytest.raises(FileFormatError, match="state is compressed, expected the file itself"):
        js.load(path)
    path.write_bytes(b"LammpS RestartT\0" + bytes(50))
    with pytest.raises(FileFormatError, match="state is a restart file of LAMMPS, expected"):
        js.load(path)


def test_a_data_file_of_discs(path):
    rows = "1 1 1.5 1.0 10.0 10.0 0.0\n2 1 1.0 1.0 10.5 10.8 0.0"
    path.write_text(changed(("# ellipsoid", "# sphere"), (ATOMS, rows), (ELLIPSOIDS, "")))
    packing = js.load(path, shape=RODS)
    np.testing.assert_array_equal(packing.diameters, [[1.5] * 3, [1.0] * 3])
    assert packing.dimension == 2
    path.write_text(path.read_text().replace("1 1 1.5", "1 1 0.0"))
    with pytest.raises(FileFormatError, match="diameter holds 0, expected particles of positive"):
        js.load(path, shape=RODS)


def test_molecules_and_charges_of_a_hybrid_are_kept(path):
    rows = "2 1 10.5 10.8 0.0 1 1.0 7 0.25\n1 1 10.0 10.0 0.0 1 1.0 8 0.5"
    path.write_text(changed(("# ellipsoid", "# hybrid ellipsoid full"), (ATOMS, rows)))
    columns = js.load(path, shape=RODS).columns
    assert {name: column.tolist() for name, column in columns.items()} == {
        "mol": [8, 7], "q": [0.5, 0.25],
    }  # fmt: skip


def test_blocks_of_lammps_from_2026_on_tell_the_exponent(path):
    path.write_text(changed(("1 0 0 0\n", "1 0 0 0 3.0 3.0000000000000004\n")))
    packing = js.load(path)
    assert (packing.shape_style, packing.dimension) == ("superellipsoid", 2)
    np.testing.assert_array_equal(packing.exponent, 1.5)
    with pytest.raises(FileFormatError, match="the file has exponents, which no dimer has"):
        js.load(path, shape="dimer")


def test_two_blocks_of_lammps_are_both_exponents(path):
    path.write_text(changed(("1 0 0 0\n", "1 0 0 0 5.0 3.0\n")))
    packing = js.load(path)
    assert (packing.shape_style, packing.dimension) == ("superellipsoid", 2)
    np.testing.assert_array_equal(packing.form, [[5.0, 3.0]] * 2)
    np.testing.assert_array_equal(packing.exponent, 1.5)  # that of the plane


@pytest.mark.parametrize("height", [(-0.1, 0.1), (-5, 5), (0, 1e-3), (-0.5, 0.5)])
def test_a_plane_box_of_any_height(path, height):
    path.write_text(changed(("-0.5 0.5 z", "{} {} z".format(*height))))
    with pytest.warns(UserWarning, match=NO_SHAPE.format(2)):
        packing = js.load(path)
    assert (packing.dimension, packing.phi) == (2, pytest.approx(PHI, rel=1e-14))
    if height == (-0.5, 0.5):
        assert js.load(path, shape=RODS).dimension == 2
    else:
        with pytest.warns(UserWarning, match="does not state its dimension.*: it is read as 2D"):
            assert js.load(path, shape=RODS).dimension == 2
    assert js.load(path, shape=RODS, dimension=2).phi == packing.phi
    assert js.load(path, shape=RODS, dimension=3).dimension == 3


def test_a_plane_is_one_to_within_rounding(path):
    """Planes from fix rigid, and from a program that rotated particles about z by matrices."""
    turned = changed(
        ("1 5 1 1 1 0 0 0", "1 5 1 1 0.8 6e-17 -1e-17 0.6"),
        ("10.0 0.0\n", "10.0 1e-16\n"),
        ("zlo zhi", "zlo zhi\n1.5 1e-16 0 xy xz yz"),
        ("2 5 1 1 1", "2 5 1.0000000000000002 1 1"),
    )
    path.write_text(turned)
    packing = js.load(path, shape=RODS)
    assert (packing.dimension, packing.phi) == (2, pytest.approx(PHI, rel=1e-14))
    assert packing.orientation[0] == pytest.approx(2 * np.arctan2(0.6, 0.8), abs=1e-15)
    assert js.load(path, shape=RODS, dimension=2).dimension == 2
    path.write_text(turned.replace("6e-17", "6e-7"))
    assert js.load(path, shape=RODS).dimension == 3
    with pytest.raises(FileFormatError, match="expected a two-dimensional packing"):
        js.load(path, shape=RODS, dimension=2)


def test_discs_are_round_to_within_rounding(path):
    path.write_text(changed(("1 5 1 1", "1 1.0000000000000002 1 1"), ("2 5 1 1", "2 1 1 1")))
    assert js.load(path, shape=RODS).is_round.all()


@pytest.mark.parametrize("sizes", ["3 1 1", "1 3 1", "1 1 3"])
def test_rods_along_another_axis_are_the_same_rods(path, sizes):
    axis = sizes.split().index("3")
    # The body's long axis points along (1, 2, 2) / 3 in each case.
    half = np.eye(3)[axis] + np.array([1, 2, 2]) / 3
    w, vector = half[axis], np.cross(np.eye(3)[axis], half)
    q = " ".join(f"{x:.17g}" for x in np.array([w, *vector]) / np.linalg.norm([w, *vector]))
    path.write_text(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp pp\n0 10\n0 10\n0 10\n"
        "ITEM: ATOMS id type x y z quatw quati quatj quatk shapex shapey shapez\n"
        f"1 1 3 3 5 {q} {sizes}\n2 1 7 7 6 {q} {sizes}\n"
    )
    with pytest.warns(UserWarning, match=NO_SHAPE.format(3)):
        packing = js.load(path)
    assert packing.phi == pytest.approx(2 * (np.pi / 2 + np.pi / 6) / 1000, rel=1e-14)
    np.testing.assert_allclose(packing.axes, np.tile([1 / 3, 2 / 3, 2 / 3], (2, 1)), atol=1e-15)
    assert js.load(path, shape=RODS).phi == packing.phi
    assert js.load(path, shape="dimer").shape_style == "dimer"
    with pytest.warns(UserWarning, match="does not state the exponents"):
        bodies = js.load(path, shape="superellipsoid")
    assert bodies.phi == pytest.approx(0.00314159, rel=1e-5)


def test_six_digits_are_said_to_cost_overlaps(path):
    path.write_text(changed(("10.5 10.8", "10.5123 10.8"), ("20 x", "20.0 x")))
    with pytest.warns(UserWarning, match="of 6 digits, with errors up to 5e-05, 5e-05 of the"):
        js.load(path, shape=RODS)


@pytest.mark.parametrize(
    ("name", "dimension"),
    [(name, dimension) for name, shape in SHAPES.items() for dimension in shape.dimensions],
)
def test_what_we_write_says_what_it_holds(path, name, dimension):
    shape = SHAPES[name]
    usual = {p.name: p.read(p.default) for p in shape.needed}
    diameters, form = shape.sizes(usual, np.array([1.0, 1.3]))
    if shape.has_exponent:
        form = np.array([[1.5], [2.5]])
    here = np.zeros((2, dimension))
    here[1, 0] = 1.9
    packing = Packing(
        position=1 + here,
        orientation=[0.1, 0.2] if dimension == 2 else [[1, 0, 0, 0]] * 2,
        diameters=diameters,
        species=[1, 1],
        id=[2, 1],
        box=Box(lo=[0] * dimension, edges=[8] * dimension),
        shape_style=name,
        form=form,
        law=Interaction(2.5, 1),
    )
    js.save(path.with_suffix(".data"), packing)
    found, expected = js.load(path.with_suffix(".data")), packing.sorted_by_id()
    for field in ("dimension", "shape_style", "law", "phi", "n"):
        assert getattr(found, field) == getattr(expected, field), field
    np.testing.assert_array_equal(found.form, expected.form)
    np.testing.assert_array_equal(found.diameters, expected.diameters)


@pytest.mark.lammps
def test_lammps_reads_what_we_write_with_its_comments(tmp_path):
    packing = Packing(
        position=[[1, 1, 1], [2.9, 1, 1]],
        orientation=[[1, 0, 0, 0], [0.6, 0, 0, 0.8]],
        diameters=[[2, 2, 2]] * 2,
        species=[1, 2],
        id=[1, 2],
        box=Box(lo=[0, 0, 0], edges=[8, 8, 8]),
        shape_style="superellipsoid",
        exponent=[2.25, 10 / 3],
    )
    write_data(tmp_path / "ours.data", packing)
    run_lmp_well(
        "units lj\natom_style ellipsoid\nread_data ours.data\npair_style zero 1.0\npair_coeff * *\n"
        "run 0\nwrite_data theirs.data nocoeff\n",
        tmp_path,
    )
    with pytest.warns(UserWarning, match="does not state the exponents"):
        theirs = read_data(tmp_path / "theirs.data", 3, "superellipsoid")
    np.testing.assert_array_equal(theirs.position, packing.position)
    np.testing.assert_allclose(theirs.orientation, packing.orientation, atol=1e-16)


@pytest.mark.lammps
def test_a_dump_of_fix_rigid_in_the_plane_reads_back(tmp_path):
    """Its quaternions leave the plane by rounding."""
    (tmp_path / "rods.data").write_text(changed(("10.5 10.8", "11.5 10.8")))
    run_lmp_well(
        "units lj\ndimension 2\natom_style ellipsoid\natom_modify map array\nread_data rods.data\n"
        "set atom 1 quat 0 0 1 35\nset atom 2 quat 0 0 1 80\npair_style zero 1\npair_coeff * *\n"
        "neigh_modify exclude group all all\nfix r all rigid single torque * off off on force * on on off\n"
        "velocity all set 0.3 0.2 0\nvariable f atom 0.05*(y-10)\nfix a all addforce 0.1 v_f 0\n"
        "fix e all enforce2d\ncompute q all property/atom quatw quati quatj quatk shapex shapey shapez\n"
        "dump d all custom 100 rods.dump id type x y z c_q[*]\n"
        "dump_modify d sort id format float %.17g\nthermo_style custom step pe\ntimestep 0.01\nrun 200\n",
        tmp_path,
    )
    names = ["quatw", "quati", "quatj", "quatk", "shapex", "shapey", "shapez"]
    text = (tmp_path / "rods.dump").read_text()
    for k, name in enumerate(names, 1):
        text = text.replace(f"c_q[{k}]", name)
    assert re.search(r"e-1[67]", text), "no rounding out of the plane"
    (tmp_path / "rods.dump").write_text(text)
    frames = read_dump(tmp_path / "rods.dump", shape=RODS)
    assert [frame.dimension for frame in frames] == [2, 2, 2]
    assert all(frame.phi == pytest.approx(PHI, rel=1e-14) for frame in frames)
    assert np.ptp([frame.orientation[0] for frame in frames]) > 1e-3


DISCS = """1 8.8767069662298361 7.254758383968503
2 0.059481123461803724 2.1385979775910764
3 2.4694173606288081 4.7755001031424884
4 6.0292182826694454 0.22236139710525268
5 5.5615954890760335 5.2120391800267747
6 0.60329674327656779 4.0617315606256446
7 2.0551790531853151 2.2633237872532983
8 0.92217163156644888 6.0388375891240509
9 3.6441763659566364 0.46487796941193305
10 6.9595452979294494 2.4322762560624369
11 4.2678726517533168 3.1919539651122895
12 8.4215430695368401 0.049073880249953669
13 3.7601085052506495 6.7966197174681131
14 7.9547166101854403 5.0440810567318968
15 1.4535012083627461 8.3791982947573977
16 6.4855578360586321 7.4264381068616521"""


def test_a_published_packing_of_discs(path):
    """N16 0001 of vanheckelab/jambashbulk, whose stiffness is that of ours times the square of a pair's distance."""
    size = [2.0] * 8 + [2.7999999999999998] * 8
    rows = [line.split() for line in DISCS.splitlines()]
    path.write_text(
        "jambash\n\n16 atoms\n2 atom types\n16 ellipsoids\n\n0 9.5393607291793074 xlo xhi\n"
        "0 9.5693366275464147 ylo yhi\n-0.5 0.5 zlo zhi\n0.063057565492152523 0 0 xy xz yz\n\n"
        "Atoms # ellipsoid\n\n"
        + "".join(f"{i} {1 + (int(i) > 8)} 1 1.0 {x} {y} 0\n" for i, x, y in rows)
        + "\nEllipsoids\n\n"
        + "".join(f"{i} {d:.17g} {d:.17g} {d:.17g} 1 0 0 0\n" for i, d in enumerate(size, 1))
    )
    packing = js.load(path, shape=RODS)
    assert packing.phi == pytest.approx(0.8149490663450825, rel=1e-15)
    assert packing.z == 4.125
    network = find_contacts(packing)
    distance = packing.radius[network.pairs].sum(axis=1)
    energy = float((distance**2 * network.energy).sum())
    assert energy == pytest.approx(1.0928358570711e-4, rel=1e-10)
