import numpy as np
import pytest
from dumps import iter_dump, read_dump
from lammps_runs import run_lmp_well
from nasty import NASTY, assert_identical, nasty_packing, tilted_box

import jamshape as js
from jamshape.files.h5md import FileFormatError, write_run
from jamshape.files.lammps_text import read_any, read_data, write_data, write_dump
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing

RODS = "spherocylinder"
COLUMNS = ["id", "type", "x", "y", "z"]
COLUMNS += ["quatw", "quati", "quatj", "quatk", "shapex", "shapey", "shapez"]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "file"


def three(vectors):
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def dump_frame(packing, columns=COLUMNS, header=""):
    """Format one frame as LAMMPS does with ``dump_modify format float %.17g``."""
    values = {"id": packing.id, "type": packing.species, "mol": np.full(packing.n, "rod")}
    values |= zip("xyz", three(packing.position).T, strict=True)
    values |= zip(["ix", "iy", "iz"], three(packing.image).T, strict=True)
    values |= zip(COLUMNS[5:9], packing.quaternions.T, strict=True)
    values |= zip(COLUMNS[9:], packing.diameters.T, strict=True)
    box, flat = packing.box, [(-0.5, 0.5)] * (3 - packing.dimension)
    bounds = [*zip(*box.bounds, strict=True), *flat]
    tilts = [*box.tilt, 0, 0][:3]
    rows = zip(*(values[name] for name in columns), strict=True)
    lines = [
        f"{header}ITEM: TIMESTEP\n{packing.step}\nITEM: NUMBER OF ATOMS\n{packing.n}",
        f"ITEM: BOX BOUNDS {'xy xz yz ' * box.is_tilted}pp pp pp",
        *(
            f"{lo:.16e} {hi:.16e}" + f" {tilt:.16e}" * box.is_tilted
            for (lo, hi), tilt in zip(bounds, tilts, strict=True)
        ),
        f"ITEM: ATOMS {' '.join(columns)} ",
        *(" ".join(x if isinstance(x, str) else f"{x:.17g}" for x in row) + " " for row in rows),
    ]
    return "\n".join(lines) + "\n"


def from_text(packing, **changes):
    """Return what a text file can hold of a packing, in the order of its reader."""
    lo, edges, tilt = packing.box.lo, packing.box.edges, packing.box.tilt
    box = Box(lo=lo, edges=(lo + edges) - lo, tilt=tilt)
    changes = {"box": box, "time": 0.0} | changes
    return packing.sorted_by_id().with_(**changes)


def assert_identical_but_angles(found, expected):
    if expected.dimension == 2:
        np.testing.assert_allclose(found.orientation, expected.orientation, rtol=0, atol=5e-16)
        found = found.with_(orientation=expected.orientation)
    assert_identical(found, expected)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("given", [True, False])
def test_data_file_comes_back_to_the_last_bit(path, dimension, given):
    packing = nasty_packing(dimension)
    write_data(path, packing)
    found = read_data(path, dimension if given else None)
    assert_identical_but_angles(found, from_text(packing, step=0))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("given", [True, False])
def test_a_tilt_is_kept_in_data_files(path, dimension, given):
    packing = nasty_packing(dimension, box=tilted_box(dimension))
    write_data(path, packing)
    found = read_data(path, dimension if given else None)
    assert_identical_but_angles(found, from_text(packing, step=0))
    if dimension == 2:
        path.write_text(path.read_text().replace(" 0 0 xy xz yz", " 0 0.5 xy xz yz"))
        with pytest.raises(FileFormatError, match="a tilt out of the plane is not 0"):
            read_data(path, 2)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_tilt_is_kept_in_dumps(path, dimension):
    """Dumps hold the bounds of the cuboid around the box."""
    packing = nasty_packing(dimension, box=tilted_box(dimension))
    frames = [packing, nasty_packing(dimension)]
    path.write_text("".join(dump_frame(one, [*COLUMNS, "ix", "iy", "iz"]) for one in frames))
    found, plain = read_dump(path, shape=RODS)
    expected = from_text(packing)
    np.testing.assert_allclose(found.box.lo, expected.box.lo, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.box.matrix, expected.box.matrix, rtol=1e-15)
    assert_identical_but_angles(found.with_(box=expected.box), expected)
    assert not plain.box.is_tilted


def test_edges_are_exact_from_a_corner_at_zero_or_a_centred_box(path):
    edges = np.array([np.nextafter(7, 8), 1 / 3])
    for lo in (np.zeros(2), -edges / 2):
        write_data(path, nasty_packing(2, box=Box(lo=lo, edges=edges)))
        np.testing.assert_array_equal(read_data(path).box.edges, edges)


def test_data_file_reads_as_lammps_asks(path):
    write_data(path, nasty_packing(2), density=0.25)
    lines = path.read_text().splitlines()
    assert "6 atoms" in lines
    assert "2 atom types" in lines
    assert "6 ellipsoids" in lines
    assert "-0.5 0.5 zlo zhi" in lines
    atoms = lines[lines.index("Atoms # ellipsoid") + 2 :][:6]
    assert all(row.split()[2:4] == ["1", "0.25"] and len(row.split()) == 10 for row in atoms)
    ellipsoids = lines[lines.index("Ellipsoids") + 2 :]
    assert all(len(row.split()) == 8 for row in ellipsoids)


def test_superellipsoids_are_told_by_their_diameters(path):
    packing = nasty_packing(3, shape_style="superellipsoid", diameters=np.tile([1, 2, 3], (6, 1)))
    write_data(path, packing)
    assert_identical(read_data(path), from_text(packing, step=0))


def test_data_file_without_images_with_comments_and_other_sections(path):
    path.write_text(
        "a comment\n\n2 atoms # and a comment\n1 atom types\n2 ellipsoids\n\n"
        "0 4 xlo xhi\n0 4 ylo yhi\n-0.5 0.5 zlo zhi\n\n"
        "PairIJ Coeffs # spherocylinder/harmonic\n\n1 1 1\n\n"
        "Atoms # ellipsoid\n\n2 1 1 1 1.5 2.5 0\n1 1 1 1 0.5 0.5 0\n\n"
        "Velocities\n\n1 0 0 0 0 0 0\n2 0 0 0 0 0 0\n\n"
        "Ellipsoids\n\n1 2 1 1 1 0 0 0\n2 3 1 1 0 0 0 1 # turned\n"
    )
    packing = read_data(path)
    np.testing.assert_array_equal(packing.position, [[0.5, 0.5], [1.5, 2.5]])
    np.testing.assert_array_equal(packing.orientation, [0, np.pi])
    np.testing.assert_array_equal(packing.half_length, [0.5, 1])
    np.testing.assert_array_equal(packing.image, np.zeros((2, 2)))


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("6 atoms", "7 atoms", "section Atoms has 6 rows for 7 atoms, expected one for each"),
        ("6 atoms", "", "the header has no line 'N atoms', expected a LAMMPS data file"),
        ("Ellipsoids", "Lines", "section Ellipsoids has 0 rows for 6 atoms"),
        ("xlo xhi", "x", "the header describes no box, expected 'xlo xhi'"),
        (
            "zlo zhi\n",
            "zlo zhi\n0.1 0 xy xz yz\n",
            "the header describes no box, expected 'xlo xhi'",
        ),
        ("zlo zhi\n", "zlo zhi\n0.1 0 -inf xy xz yz\n", "box tilt holds NaN or infinity"),
        ("-0.5 0.5 zlo", "-0.5 nan zlo", "the header describes no box"),
        ("\n1 1 1 ", "\n1 1 ", r"row '1 1 .* has 9 columns, expected 'id type ellipsoidflag"),
        ("\n1 1 1 ", "\n9 1 1 ", "Atoms and Ellipsoids hold different ids"),
        ("\n1 1 1 ", "\n1.5 1 1 ", "Atoms and Ellipsoids hold different ids"),
        ("\n1 1 1 ", "\n1 1.5 1 ", "a column of integers holds other numbers"),
        ("\n1 1 1 ", "\n1 one 1 ", "could not convert string to float: 'one'"),
        ("\n1 1 1 1 ", "\n1 1 1 1 nan 0 0 0 0 0 #", "position holds NaN or infinity"),
    ],
)
def test_wrong_data_file(path, old, new, sentence):
    write_data(path, nasty_packing(3, id=np.arange(1, 7), box=Box([-0.5] * 3, [1.0] * 3)))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileFormatError, match=f"file: ({sentence})"):
        read_data(path)


def test_data_file_cut_anywhere_is_refused(path):
    write_data(path, nasty_packing(2))
    text = path.read_text()
    for end in range(0, len(text) - 1, 7):
        path.write_text(text[:end])
        with pytest.raises(FileFormatError):
            read_data(path)
    path.write_text(text[:-3])
    with pytest.raises(FileFormatError, match="the file ends within a line, expected a complete"):
        read_data(path)


def test_dimension_two_is_refused_out_of_the_plane(path):
    write_data(path, nasty_packing(3))
    with pytest.raises(FileFormatError, match="out of the plane is not 0, expected a two"):
        read_data(path, dimension=2)


def test_flat_file_can_be_read_as_three_dimensional(path):
    write_data(path, nasty_packing(2))
    assert read_data(path, dimension=3).position.shape == (6, 3)
    assert read_data(path).dimension == 2


def test_failing_write_leaves_the_old_file(path, monkeypatch):
    write_data(path, nasty_packing(2))
    old = path.read_bytes()

    def fail(*_args, **_keywords):
        msg = "No space left on device"
        raise OSError(msg)

    monkeypatch.setattr(np, "savetxt", fail)
    with pytest.raises(OSError, match="No space left"):
        write_data(path, nasty_packing(3))
    assert path.read_bytes() == old
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("density", [0, -1, np.nan, np.inf])
def test_density_is_refused(path, density):
    with pytest.raises(ValueError, match=f"density is {density}, expected a positive number"):
        write_data(path, nasty_packing(2), density)


@pytest.mark.parametrize("dimension", [2, 3])
def test_dump_comes_back_to_the_last_bit(path, dimension):
    frames = [nasty_packing(dimension, step=step) for step in (0, 2**40)]
    no_image = {"image": np.zeros((6, dimension), int)}
    path.write_text("".join(map(dump_frame, frames)))
    found = read_dump(path, shape=RODS)
    assert len(found) == 2
    for packing, expected in zip(found, frames, strict=True):
        assert_identical_but_angles(packing, from_text(expected, **no_image))
    assert set(found[0].position[:, 0]) == set(NASTY)


def test_dump_columns_may_come_in_any_order(path):
    packing = nasty_packing(3)
    columns = ["mol", "iz", *reversed(COLUMNS), "ix", "iy"]
    header = f"ITEM: UNITS\nlj\nITEM: TIME\n{packing.time:.17g}\n"
    path.write_text(dump_frame(packing, columns, header))
    (found,) = read_dump(path, shape=RODS)
    assert_identical(found, from_text(packing, time=packing.time))


def test_dump_cut_anywhere_gives_the_complete_frames_before(path):
    whole = [dump_frame(nasty_packing(2, step=step)) for step in (0, 1)]
    for end in range(1, len(whole[1]) - 1, 5):
        path.write_text(whole[0] + whole[1][:end])
        frames = iter_dump(path, shape=RODS)
        assert next(frames).step == 0
        with pytest.raises(FileFormatError, match="file: frame 1: "):
            next(frames)
    path.write_text(whole[0] + whole[1][:-9])
    with pytest.raises(FileFormatError, match="frame 1: the file ends within the frame, expected"):
        read_dump(path, shape=RODS)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("shapey", "shape2", "columns 'shapey' are missing, expected 'id type x y z quatw"),
        (
            "pp pp pp",
            "xy xz yz pp pp pp",
            "box bounds 'xy xz yz pp pp pp' have rows of 2 numbers, expected 3",
        ),
        ("pp pp pp", "abc origin pp pp pp", "box bounds are 'abc origin pp pp pp', expected 'pp"),
        ("pp pp pp", "pp fx pp", "box bounds are 'pp fx pp', expected 'pp pp pp'"),
        ("ITEM: TIMESTEP\n7\n", "", r"items \['TIMESTEP'\] are missing before the atoms"),
        (
            "ITEM: BOX",
            "ITEM: CUBE",
            "a line reads 'ITEM: CUBE BOUNDS pp pp pp', expected an 'ITEM:",
        ),
        ("OF ATOMS\n6", "OF ATOMS\n0", "packing has no particles"),
        ("OF ATOMS\n6", "OF ATOMS\n5", "a line reads '6 .*', expected an 'ITEM:' line"),
        ("OF ATOMS\n6", "OF ATOMS\n7", "the file ends within the frame"),
        ("\n1 1 ", "\n1 1 nan ", "row .* has 13 columns, expected 'id type x y z"),
        ("\n1 1 ", "\n2 1 ", "an id occurs more than once"),
    ],
)
def test_wrong_dump(path, old, new, sentence):
    text = dump_frame(nasty_packing(2, step=7, id=np.arange(1, 7)))
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileFormatError, match=f"file: frame .: {sentence}"):
        read_dump(path, shape=RODS)


def test_empty_dump_has_no_frames(path):
    path.write_text("")
    assert read_dump(path, shape=RODS) == []


def test_read_any_tells_the_format_by_content(path):
    packing = nasty_packing(3)
    write_data(path, packing)
    assert_identical(read_any(path), from_text(packing, step=0))
    path.write_text(dump_frame(packing))
    assert read_any(path, shape=RODS).step == packing.step
    path.unlink()
    write_run(path, [packing, packing.with_(step=packing.step + 1)])
    assert_identical(read_any(path, 0), packing)
    assert read_any(path).step == packing.step + 1


def test_read_any_takes_frames_from_either_end(path):
    path.write_text("".join(dump_frame(nasty_packing(2, step=step)) for step in range(3)))
    assert [read_any(path, frame, shape=RODS).step for frame in (0, 1, 2, -1, -2, -3)] == [
        0,
        1,
        2,
        2,
        1,
        0,
    ]
    for frame in (3, -4):
        with pytest.raises(ValueError, match=f"has 3 frames, expected frame {frame} to be one"):
            read_any(path, frame, shape=RODS)


def test_read_any_reads_a_dump_no_further_than_asked(path):
    path.write_text(dump_frame(nasty_packing(2, step=0)) + "ITEM: TIMES")
    assert read_any(path, 0, shape=RODS).step == 0
    with pytest.warns(UserWarning, match="ends within frame 1, which is left out"):
        assert read_any(path, shape=RODS).step == 0
    path.write_text(dump_frame(nasty_packing(2))[:-9])
    with pytest.raises(FileFormatError, match="frame 0: the file ends within the frame"):
        read_any(path, shape=RODS)


def test_read_any_refuses_other_files(path):
    path.write_bytes(bytes(range(256)) + b"\n")
    with pytest.raises(
        FileFormatError, match="the header has no line 'N atoms', expected a LAMMPS"
    ):
        read_any(path)
    with pytest.raises(FileNotFoundError):
        read_any(path.with_name("nowhere"))


@pytest.mark.lammps
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("tilted", [False, True])
def test_lammps_reads_our_data_file_and_we_read_its_files(tmp_path, dimension, tilted):
    rng = np.random.default_rng(3)
    edges = np.full(dimension, 7.1)
    tilt = np.array([3.1, -2.2, 1.3])[: 2 * dimension - 3]
    box = Box(np.zeros(dimension), edges, tilt if tilted else 0 * np.abs(tilt))
    packing = nasty_packing(
        dimension,
        position=box.vectors(rng.uniform(0, 7, (6, dimension)) / edges),
        box=box,
        step=0,
        time=0.0,
    )
    write_data(tmp_path / "data.in", packing)
    computes = "".join(f"compute {name} all property/atom {name}\n" for name in COLUMNS[5:])
    run_lmp_well(
        f"units lj\ndimension {dimension}\natom_style ellipsoid\nread_data data.in\n{computes}"
        f"dump 1 all custom 1 dump.out id type x y z ix iy iz c_{' c_'.join(COLUMNS[5:])}\n"
        "dump_modify 1 format float %.17g\n"
        "pair_style zero 1.0\npair_coeff * *\nrun 0\nwrite_data data.out\n",
        tmp_path,
    )
    expected = packing.sorted_by_id()
    for name in ("dump.out", "data.out"):
        found = read_any(tmp_path / name, dimension=dimension, shape=RODS)
        # LAMMPS normalises quaternions as it reads them.
        np.testing.assert_allclose(found.orientation, expected.orientation, rtol=0, atol=1e-15)
        # And rounds what goes through the cell vectors.
        rounding = {"rtol": 0, "atol": 1e-14 * tilted}
        np.testing.assert_allclose(found.position, expected.position, **rounding)
        np.testing.assert_allclose(found.box.lo, box.lo, **rounding)
        np.testing.assert_allclose(found.box.matrix, box.matrix, **rounding)
        known = {"orientation": expected.orientation}
        known |= {"position": expected.position, "box": box} if tilted else {}
        assert_identical(found.with_(**known), expected)


ROUNDNESS = ["SuperquadricRoundness.Phi", "SuperquadricRoundness.Theta"]


def dump_of_bodies(packing, columns):
    """Dump of a deck of bodies with an exponent, with 1/p computed in LAMMPS."""
    plain = dump_frame(packing)
    given = dict.fromkeys(ROUNDNESS, 1 / packing.exponent)
    given |= dict.fromkeys(("exponent", "v_exponent"), packing.exponent)
    head, rows = plain.split("shapez \n")
    more = zip(*(given[name] for name in columns), strict=True)
    lines = [f"{row}{' '.join(f'{x:.17g}' for x in numbers)} \n" for row, numbers in
             zip(rows.splitlines(), more, strict=True)]  # fmt: skip
    return f"{head}shapez {' '.join(columns)} \n{''.join(lines)}"


def bodies(dimension):
    p = 0.5 + np.random.default_rng(5).random(len(NASTY))
    return nasty_packing(dimension, exponent=p, shape_style="superellipsoid").sorted_by_id()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("column", ["exponent", "v_exponent"])
def test_a_dump_tells_the_exponent_to_the_last_bit(path, dimension, column):
    expected = bodies(dimension)
    path.write_text(dump_of_bodies(expected, [column, *ROUNDNESS]))
    [found] = read_dump(path)
    assert found.shape_style == "superellipsoid"
    np.testing.assert_array_equal(found.exponent, expected.exponent)
    assert len(set(found.exponent)) > 1


@pytest.mark.parametrize("dimension", [2, 3])
def test_roundness_alone_tells_the_exponent_to_rounding(path, dimension):
    expected = bodies(dimension)
    path.write_text(dump_of_bodies(expected, ROUNDNESS))
    [found] = read_dump(path)
    assert found.shape_style == "superellipsoid"
    np.testing.assert_allclose(found.exponent, expected.exponent, rtol=3e-16)


def with_two_exponents(dimension):
    n = 1.1 + 18 * np.random.default_rng(6).random((len(NASTY), 2))
    packing = nasty_packing(dimension, form=n, shape_style="superellipsoid").sorted_by_id()
    return packing.with_(step=0, time=0.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_two_exponents_survive_data_files_and_dumps_to_the_last_bit(path, dimension):
    expected = with_two_exponents(dimension)
    write_data(path, expected)
    assert_identical(read_data(path), expected)
    write_dump(path, expected)
    [found] = read_dump(path)
    np.testing.assert_array_equal(found.form, expected.form)


@pytest.mark.parametrize("make", [bodies, with_two_exponents])
def test_rows_for_lammps_from_2026_on_have_both_exponents(path, make):
    expected = make(3).with_(step=0, time=0.0)
    write_data(path, expected, blocks=True)
    rows = path.read_text().partition("Ellipsoids\n\n")[2].splitlines()
    assert all(len(row.split()) == 10 and "#" not in row for row in rows)
    assert_identical(read_data(path), expected)


@pytest.mark.parametrize(
    "particles",
    [js.Spherocylinders(alpha=2), js.Dimers(), js.Clumps(discs=js.dimer_discs(0.5))],
    ids=["rods", "dimers", "clumps"],
)
def test_rows_for_lammps_from_2026_on_have_the_exponents_of_ellipsoids(path, particles):
    """With which LAMMPS holds the particles of any other shape."""
    packing = random_packing(8, 0.2, 1, particles)
    write_data(path, packing)
    expected = read_data(path)
    write_data(path, packing, blocks=True)
    rows = path.read_text().partition("Ellipsoids\n\n")[2].splitlines()
    assert all(row.partition("#")[0].split()[8:] == ["2", "2"] for row in rows)
    assert_identical(read_data(path), expected)
    assert expected.shape_style == packing.shape_style


@pytest.mark.parametrize("columns", [["block1", "block2"], ["c_block1", "c_block2"], ROUNDNESS])
def test_dumps_of_others_tell_two_exponents(path, columns):
    expected = with_two_exponents(3)
    head, rows = dump_frame(expected).split("shapez \n")
    numbers = expected.form if "block" in columns[0] else 2 / expected.form
    lines = [
        f"{row}{a:.17g} {b:.17g} \n" for row, (a, b) in zip(rows.splitlines(), numbers, strict=True)
    ]
    path.write_text(f"{head}shapez {' '.join(columns)} \n{''.join(lines)}")
    [found] = read_dump(path)
    assert found.shape_style == "superellipsoid"
    np.testing.assert_allclose(found.form, expected.form, rtol=5e-16)
    with pytest.raises(
        ValueError, match="two exponents has no p, expected one exponent each; use form"
    ):
        _ = found.exponent


def test_roundnesses_that_are_not_positive_are_refused(path):
    text = dump_of_bodies(bodies(3), ROUNDNESS)
    head, tail = text.split("Theta \n")
    first, rest = tail.split("\n", 1)
    path.write_text(f"{head}Theta \n{first.rsplit(' ', 2)[0]} -0.25 \n{rest}")
    with pytest.raises(FileFormatError, match="Theta is not positive, expected 2/n1 and 2/n2"):
        read_dump(path)
