"""Frames of every kind of file, and states of others: columns, compression, open boundaries."""

import gzip
import pickle
import shutil
import subprocess
import tracemalloc

import numpy as np
import pytest
from exchanged import PLACES, mixed, tilted
from written import FINISHED

import jamshape as js
from jamshape.files.dump_index import index_of
from jamshape.files.h5md import FileFormatError, read_packing, write_run
from jamshape.files.lammps_text import DumpFile, write_dump
from jamshape.protocols.random_start import random_packing

RODS = "spherocylinder"
N_FRAMES = 7


@pytest.fixture(scope="module")
def sequence():
    packing = random_packing(n=12, phi=0.3, seed=1).sorted_by_id()
    return [packing.with_(step=3 * k, time=k / 7) for k in range(N_FRAMES)]


@pytest.fixture(scope="module", params=[".h5", ".dump", ".gsd", ".dump.gz"])
def path(request, sequence, tmp_path_factory):
    if request.param == ".gsd":
        pytest.importorskip("gsd")
    path = tmp_path_factory.mktemp("frames") / f"run{request.param}"
    plain = path.with_suffix("") if path.suffix == ".gz" else path
    write_run(path.parent / "all.h5", sequence)
    js.save(plain, js.frames(path.parent / "all.h5"))
    if path != plain:
        path.write_bytes(gzip.compress(plain.read_bytes()))
    return path


def test_frames_are_a_sequence(path, sequence):
    frames = js.frames(path, shape=RODS)
    assert len(frames) == N_FRAMES
    assert (
        [packing.step for packing in frames] == frames.steps.tolist() == [p.step for p in sequence]
    )
    assert frames.times.tolist() == [p.time for p in sequence]
    assert [frames[k].step for k in (0, -1, 2)] == [0, 18, 6]
    assert [p.step for p in frames[1::2]] == frames[1::2].steps.tolist() == [3, 9, 15]
    assert [p.step for p in frames[::-1][1:3]] == frames[::-1][1:3].steps.tolist() == [15, 12]
    assert frames[2:4].times.tolist() == [2 / 7, 3 / 7]
    assert len(frames[20:]) == 0
    assert list(frames[20:]) == []
    assert repr(frames) == f"<7 frames of {path}>"
    assert frames[0].file == path
    for wrong in (7, -8):
        with pytest.raises(ValueError, match=f"has 7 frames, expected frame {wrong} to be one"):
            frames[wrong]
    for wrong in ([0, 1], 1.0, True, "0"):
        with pytest.raises(
            TypeError, match=r"^frames are looked up by .*, expected a whole number or"
        ):
            frames[wrong]
    np.testing.assert_array_equal(frames[np.int64(3)].position, sequence[3].position)
    again = pickle.loads(pickle.dumps(frames))
    assert [p.step for p in again] == frames.steps.tolist()
    assert js.load(path, -1, shape=RODS).step == 18


def test_frames_refuse_another_meaning_and_modes(path):
    if ".dump" not in path.name:
        with pytest.raises(ValueError, match="has shape spherocylinder, expected dimer"):
            js.frames(path, shape="dimer")
    with pytest.raises(FileNotFoundError):
        js.frames(path.with_name("nowhere"))


def test_one_packing_is_one_frame(tmp_path, sequence):
    for name in ("one.h5", "one.data"):
        js.save(tmp_path / name, sequence[0])
        frames = js.frames(tmp_path / name)
        assert (len(frames), frames[-1].n, frames.steps.tolist()) == (1, 12, [0])
        assert len(pickle.loads(pickle.dumps(frames))) == 1


def test_a_recorded_run_iterates_over_the_same_frames(tmp_path, sequence):
    write_run(tmp_path / "run.h5", sequence, FINISHED | {"kappa": 1e-3})
    run = js.load(tmp_path / "run.h5")
    pairs = zip(run, js.frames(tmp_path / "run.h5"), strict=True)
    for k, (one, other) in enumerate(pairs):
        assert one.position.tobytes() == other.position.tobytes()
        assert one.results == other.results == run.packing(k).results
        assert one.step == run.packing(k).step


def test_a_run_that_grows_keeps_the_frames_before(tmp_path, sequence):
    write_run(tmp_path / "run.h5", sequence[:4])
    frames = js.frames(tmp_path / "run.h5")
    write_run(tmp_path / "run.h5", sequence)
    assert [p.step for p in frames] == [0, 3, 6, 9]
    assert len(js.frames(tmp_path / "run.h5")) == N_FRAMES


def test_a_cut_last_frame_is_left_out_with_a_warning(tmp_path, sequence):
    path = tmp_path / "run.dump"
    write_dump(path, sequence)
    whole = path.read_text()
    start = DumpFile(path).index.starts[-2]
    for end in [*range(start + 1, len(whole) - 1, 97), len(whole) - 1]:
        path.write_text(whole[:end])
        with pytest.warns(UserWarning, match="ends within frame 6, which is left out") as said:
            frames = js.frames(path, shape=RODS)
        assert (len(said), len(frames), frames[-1].step) == (1, 6, 15)
    path.write_text(whole[: start // 9])
    with pytest.raises(FileFormatError, match="frame 0: the file ends within the frame"):
        js.frames(path)


@pytest.mark.parametrize("chunk", [70, 97, 1000])
def test_an_index_is_the_same_for_any_size_of_chunks(tmp_path, sequence, monkeypatch, chunk):
    path = tmp_path / "run.dump"
    write_dump(path, sequence)
    with path.open("rb") as file:
        expected = index_of(file)
        monkeypatch.setattr("jamshape.files.dump_index._CHUNK", chunk)
        assert index_of(file) == expected
    assert expected.steps == [p.step for p in sequence]
    assert expected.times == [p.time for p in sequence]


def test_a_long_dump_is_read_in_bounded_memory(tmp_path):
    packing = random_packing(n=64, phi=0.3, seed=1)
    write_dump(tmp_path / "long.dump", (packing.with_(step=k) for k in range(600)))
    size = (tmp_path / "long.dump").stat().st_size
    frames = js.frames(tmp_path / "long.dump", shape=RODS)
    frames[0]
    tracemalloc.start()
    assert sum(1 for _ in frames) == 600
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < size / 8


def test_compressed_files(tmp_path, sequence):
    path, packing = tmp_path / "one", sequence[0]
    js.save(path.with_suffix(".data"), packing)
    plain = path.with_suffix(".data").read_bytes()
    path.write_bytes(gzip.compress(plain))
    np.testing.assert_array_equal(js.load(path).position, packing.position)
    path.write_bytes(gzip.compress(plain)[:-20])
    with pytest.raises(FileFormatError, match="the compressed file is cut or damaged"):
        js.load(path)
    js.save(path.with_suffix(".h5"), packing)
    path.write_bytes(gzip.compress(path.with_suffix(".h5").read_bytes()))
    with pytest.raises(FileFormatError, match="is compressed, expected the file itself"):
        js.load(path)


def test_files_of_zstandard(tmp_path, sequence, monkeypatch):
    js.save(tmp_path / "one.dump", sequence[3])
    plain = (tmp_path / "one.dump").read_bytes()
    if shutil.which("zstd"):
        packed = subprocess.run(["zstd", "-c"], input=plain, capture_output=True, check=True).stdout
        (tmp_path / "one.dump.zst").write_bytes(packed)
        assert js.load(tmp_path / "one.dump.zst", shape=RODS).step == 9
        (tmp_path / "one.dump.zst").write_bytes(packed[: len(packed) // 2])
        with pytest.raises(FileFormatError, match="the compressed file is cut or damaged"):
            js.load(tmp_path / "one.dump.zst", shape=RODS)
    (tmp_path / "one.dump.zst").write_bytes(b"\x28\xb5\x2f\xfd" + plain)
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(ValueError, match="expected the program zstd to unpack it; install zstd"):
        js.load(tmp_path / "one.dump.zst")


@pytest.mark.parametrize(("name", "dimension"), PLACES)
@pytest.mark.parametrize("make", [mixed, tilted])
def test_positions_may_be_unwrapped_or_in_units_of_the_box(tmp_path, name, dimension, make):
    packing = make(name, dimension).sorted_by_id()
    box, d = packing.box, dimension
    scaled = box.fractions(packing.position - box.lo)
    inside = packing.position + box.vectors(packing.image)
    inner, turns = box.wrapped(inside)
    js.save(tmp_path / "a.dump", packing)
    lines = (tmp_path / "a.dump").read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS"))
    names = lines[head].split()[2:]
    rows = [dict(zip(names, line.split(), strict=True)) for line in lines[head + 1 :]]
    for kind, values in {
        "{}s": scaled,
        "{}u": inside,
        "{}su": box.fractions(inside - box.lo),
    }.items():
        titles = dict(zip("xyz"[:d], map(kind.format, "xyz"), strict=False))
        titles |= {"z": kind.format("z")} if d == 2 else {}
        for row, value in zip(rows, values.tolist(), strict=True):
            row.update(dict(zip("xyz", map("{:.17g}".format, value), strict=False)))
            if d == 2 and "s" in kind:
                row["z"] = "0.5"
        said = [titles.get(one, one) for one in names]
        text = [
            *lines[:head],
            "ITEM: ATOMS " + " ".join(said),
            *(" ".join(r.values()) for r in rows),
        ]
        (tmp_path / "b.dump").write_text("\n".join(text) + "\n")
        found = js.load(tmp_path / "b.dump", shape=name, dimension=d)
        if kind == "{}s":
            expected, image = packing.position, packing.image
        else:
            expected, image = box.lo + inner, turns
        np.testing.assert_allclose(found.position, expected, atol=1e-12 * box.edges.max())
        np.testing.assert_array_equal(found.image, image)


def test_other_columns_are_kept_and_written_again(tmp_path, sequence):
    packing = sequence[1].with_(
        columns={
            "mol": np.arange(12) % 3,
            "element": np.array(["Ab", "C", "é"] * 4),
            "c_energy": np.linspace(0, 1, 12) / 3,
            "f_stress": np.arange(36.0).reshape(12, 3) / 7,
            "c_ave[3]": np.arange(12) / 9,
        }
    )
    mixed_up = packing.with_(**{
        name: getattr(packing, name)[::-1]
        for name in ("position", "orientation", "diameters", "species", "id", "image")
    }, columns={name: column[::-1] for name, column in packing.columns.items()})  # fmt: skip
    for name in ("a.dump", "a.lammpstrj", "a.h5", "a.gsd"):
        if name.endswith("gsd"):
            pytest.importorskip("gsd")
        if name.endswith("gsd"):
            with pytest.warns(UserWarning, match="the columns element are left out"):
                js.save(tmp_path / name, mixed_up)
        else:
            js.save(tmp_path / name, mixed_up)
        shape = RODS if "." in name and name[2] in "dl" else None
        found = js.load(tmp_path / name, shape=shape).sorted_by_id()
        expected = {
            k: x
            for k, x in packing.columns.items()
            if x.dtype.kind != "U" or shape or name[2] == "h"
        }
        assert sorted(found.columns) == sorted(expected)
        for key, column in expected.items():
            assert found.columns[key].dtype.kind == column.dtype.kind
            np.testing.assert_array_equal(found.columns[key], column)
    with pytest.warns(UserWarning, match="holds no other columns: mol, element, c_energy"):
        js.save(tmp_path / "a.data", packing)
    moved = packing.with_(position=packing.position + 1e-3)
    assert sorted(moved.columns) == ["element", "mol"]
    assert sorted(packing.with_(law=js.Interaction(2)).columns) == sorted(packing.columns)
    assert sorted(packing.with_(time=2.0, columns={}).columns) == []
    assert not pickle.loads(pickle.dumps(packing)).columns["mol"].flags.writeable


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        (
            {"a b": np.ones(12)},
            "column 'a b' has dtype float64, expected numbers or texts, and a name",
        ),
        ({"a": np.ones(11)}, r"column 'a' has shape \(11,\), expected \(12,\) or \(12, k\)"),
        ({"a": [object()] * 12}, "column 'a' has dtype object, expected numbers or texts"),
    ],
)
def test_wrong_columns_are_refused(sequence, columns, sentence):
    with pytest.raises(ValueError, match=sentence):
        sequence[0].with_(columns=columns)


def test_frames_of_a_run_hold_the_columns_that_all_have(tmp_path, sequence):
    first = sequence[0].with_(columns={"mol": np.arange(12), "c_e": np.ones(12)})
    second = first.with_(position=first.position, step=5)
    write_run(tmp_path / "run.h5", [first, second])
    assert [list(read_packing(tmp_path / "run.h5", k).columns) for k in (0, 1)] == [["mol"]] * 2


DUMP = """ITEM: TIMESTEP
5
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS {}
0 8
0 9
-0.5 0.5
ITEM: ATOMS id type x y z {}
2 1 3.0 2.0 0 {}
1 1 4.0 3.0 0 {}
"""


@pytest.mark.parametrize(
    ("names", "row"),
    [
        ("c_q[1] c_q[2] c_q[3] c_q[4] c_shape[1] c_shape[2] c_shape[3]", "1 0 0 0 3 1 1"),
        ("c_orient[1] c_orient[2] c_orient[3] c_orient[4] shapex shapey shapez", "1 0 0 0 3 1 1"),
        ("c_q[1] c_q[2] c_q[3] c_q[4] c_q[5] c_q[6] c_q[7]", "1 0 0 0 3 1 1"),
        ("c_quatw c_quati c_quatj c_quatk c_shapex c_shapey c_shapez", "1 0 0 0 3 1 1"),
        ("quatw quati quatj quatk shapex shapey shapez", "1 0 0 0 3 1 1"),
    ],
)
def test_names_of_quaternions_and_shapes(tmp_path, names, row):
    (tmp_path / "a.dump").write_text(DUMP.format("pp pp pp", names, row, row))
    found = js.load(tmp_path / "a.dump", shape=RODS)
    np.testing.assert_array_equal(found.diameters, [[3, 1, 1]] * 2)
    np.testing.assert_array_equal(found.orientation, 0)
    assert found.columns == {}


@pytest.mark.parametrize(("names", "row"), [("diameter", "1"), ("radius c_e", "0.5 7")])
def test_discs_by_their_diameter(tmp_path, names, row):
    (tmp_path / "a.dump").write_text(DUMP.format("pp pp pp", names, row, row))
    found = js.load(tmp_path / "a.dump", shape=RODS)
    np.testing.assert_array_equal(found.diameters, 1.0)
    assert list(found.columns) == names.split()[1:]


@pytest.mark.parametrize(
    ("names", "rows"),
    [
        ("x y", ("3.0 2.0", "4.0 3.0")),
        ("x y ix iy", ("3.0 2.0 1 0", "4.0 3.0 0 -2")),
        ("xu yu", ("11.0 2.0", "4.0 -13.0")),
        ("xs ys", ("0.375 0.25", "0.5 0.375")),
        ("xsu ysu", ("1.375 0.25", "0.5 -1.625")),
    ],
)
def test_a_dump_of_the_plane_needs_no_z(tmp_path, names, rows):
    text = DUMP.format("pp pp pp", "diameter", "1", "1").replace("0 9", "0 8")
    for old, new in zip(("x y z", "3.0 2.0 0", "4.0 3.0 0"), (names, *rows), strict=True):
        text = text.replace(old, new)
    (tmp_path / "a.dump").write_text(text)
    found = js.load(tmp_path / "a.dump", shape=RODS).sorted_by_id()
    assert found.dimension == 2
    np.testing.assert_array_equal(found.position, [[4, 3], [3, 2]])
    if "i" in names or "u" in names:
        np.testing.assert_array_equal(found.image, [[0, -2], [1, 0]])
    (tmp_path / "a.dump").write_text(text.replace("-0.5 0.5", "-4 4"))
    with pytest.raises(FileFormatError, match=r"columns '(x y )?z' are missing"):
        js.load(tmp_path / "a.dump", shape=RODS)


def test_nan_is_said_whatever_the_digits(tmp_path):
    text = DUMP.format("pp pp pp", "diameter", "1", "1").replace("3.0 2.0", "3.12345 nan")
    (tmp_path / "a.dump").write_text(text)
    with pytest.raises(FileFormatError, match="position holds NaN or infinity, expected finite"):
        js.load(tmp_path / "a.dump", shape=RODS)


def test_open_boundaries_are_served_where_nothing_reaches_across(tmp_path):
    (tmp_path / "a.dump").write_text(DUMP.format("ff pp pp", "diameter", "1", "1"))
    with pytest.warns(
        UserWarning, match="'ff pp pp': it is read as periodic, with the same contacts"
    ):
        assert js.load(tmp_path / "a.dump", shape=RODS).n == 2
    (tmp_path / "a.dump").write_text(DUMP.format("pp ss pp", "diameter", "8.5", "8.5"))
    with pytest.raises(FileFormatError, match="'pp ss pp' with a gap of 8 between the particles"):
        js.load(tmp_path / "a.dump", shape=RODS)
    (tmp_path / "a.dump").write_text(DUMP.format("pp pp ff", "diameter", "1", "1"))
    assert js.load(tmp_path / "a.dump", shape=RODS).dimension == 2


def test_six_digits_of_scaled_positions_are_said_in_lengths(tmp_path):
    text = DUMP.format("pp pp pp", "diameter", "1", "1").replace(" x y z", " xs ys zs")
    text = text.replace("3.0 2.0 0", "0.333333 0.5 0.5").replace("4.0 3.0 0", "0.666667 0.5 0.5")
    (tmp_path / "a.dump").write_text(text)
    with pytest.warns(UserWarning, match="of 6 digits, with errors up to 5e-06, 5e-06 of the"):
        found = js.load(tmp_path / "a.dump", shape=RODS)
    np.testing.assert_allclose(found.position[1], [0.333333 * 8, 4.5])
