import subprocess
import sys
import warnings

import numpy as np
import pytest
from jamshape.files.run_writer import RunWriter
from nasty import assert_identical, nasty_packing, tilted_box, with_rests

from jamshape.files.h5md import (
    FileFormatError,
    count_frames,
    read_attributes,
    read_observables,
    read_packing,
    read_report,
    read_series,
    write_packing,
    write_run,
)

h5py = pytest.importorskip("h5py")

FRAME_ELEMENTS = ("position", "orientation", "image", "box/edges", "box/lo")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "packing.h5"


def frame(step, dimension=2):
    """The same particles, elsewhere at each step."""
    first = nasty_packing(dimension)
    return first.with_(step=step, time=step / 3, position=first.position / (1 + step))


def run_of_three(path):
    writer = RunWriter.create(path, frame(0), observables={"pressure": 0.0})
    for step in (10, 20):
        writer.append_observables(step - 5, (step - 5) / 3, {"pressure": step / 7 - 1})
        writer.append(frame(step), {"pressure": step / 7})
        writer.append_report(step, step / 11, 1 / step)
    return writer


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("shape_style", ["spherocylinder", "superellipsoid"])
def test_packing_comes_back_to_the_last_bit(path, dimension, shape_style):
    packing = nasty_packing(dimension, shape_style=shape_style)
    write_packing(path, packing)
    assert_identical(read_packing(path), packing)
    assert_identical(read_packing(path, 0), packing)
    assert count_frames(path) == 1


def test_attributes_come_back_as_plain_types(path):
    given = {"phi_J": 0.1 + 0.2, "n": 2**62, "finished": True, "deck": "Å\nb" * 50_000}
    write_packing(path, nasty_packing(2), given | {"spread": np.array([1 / 3, np.nan])})
    found = read_attributes(path)
    np.testing.assert_array_equal(found.pop("spread"), [1 / 3, np.nan])
    assert found == given
    assert [type(value) for value in found.values()] == [type(given[name]) for name in found]


def test_observables_come_back_with_a_first_axis_for_time(path):
    given = {
        "pressure": 1 / 3,
        "z": np.nan,
        "stress": np.eye(2) / 3,
        "bonds": np.zeros((0, 14), np.int64),
    }
    write_packing(path, nasty_packing(2), observables=given)
    found = read_observables(path)
    assert found.keys() == given.keys()
    for name, value in given.items():
        np.testing.assert_array_equal(found[name], np.asarray(value)[None])
    assert found["bonds"].dtype == np.int64


@pytest.mark.parametrize("dimension", [2, 3])
def test_layout_is_h5md(path, dimension):
    write_packing(path, nasty_packing(dimension), observables={"pressure": 1.0})
    with h5py.File(path) as file:
        assert file["h5md"].attrs["version"].tolist() == [1, 1]
        assert file["h5md/author"].attrs["name"]
        assert file["h5md/creator"].attrs["name"] == b"jamshape"
        assert file["h5md/creator"].attrs["version"]
        particles = file["particles/all"]
        assert particles["box"].attrs["dimension"] == dimension
        assert particles["box"].attrs["boundary"].tolist() == [b"periodic"] * dimension
        assert particles["position/value"].shape == (1, 6, dimension)
        assert particles["box/edges/value"].shape == (1, dimension)
        for name in FRAME_ELEMENTS:
            assert particles[name]["step"] == particles["position/step"]  # one object, hard links
            assert particles[name]["time"] == particles["position/time"]
        assert {*file["observables/pressure"]} == {"step", "time", "value"}


def test_mdanalysis_opens_three_dimensional_runs(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its imports warn of their own dependencies
        h5md = pytest.importorskip("MDAnalysis.coordinates.H5MD")
    frames = [frame(step, 3).with_(position=np.full((6, 3), step / 4)) for step in (0, 10)]
    writer = RunWriter.create(path, frames[0], {"kappa": 1e-6}, {"pressure": 0.5})
    writer.append(frames[1], {"pressure": 0.75})
    writer.close()
    with h5md.H5MDReader(str(path), convert_units=False) as reader:
        assert (reader.n_frames, reader.n_atoms) == (2, 6)
        for packing, ts in zip(frames, reader, strict=True):
            np.testing.assert_array_equal(ts.positions, packing.position)
            np.testing.assert_array_equal(ts.dimensions[:3], np.float32(packing.box.edges))
            assert (ts.data["step"], ts.time) == (packing.step, packing.time)
        assert [ts.data["pressure"] for ts in reader] == [0.5, 0.75]


def test_mdanalysis_refuses_two_dimensions(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        h5md = pytest.importorskip("MDAnalysis.coordinates.H5MD")
    write_packing(path, nasty_packing(2))
    with h5py.File(path) as file, pytest.raises(ValueError, match="only supports 3-dimensional"):
        h5md.H5MDReader(file, convert_units=False)


def test_failing_write_leaves_the_old_file(path):
    old = nasty_packing(2)
    write_packing(path, old)
    with pytest.raises(ValueError, match="observable 'name' has dtype <U3, expected numbers"):
        write_packing(path, frame(1), observables={"pressure": 1.0, "name": "rod"})
    assert_identical(read_packing(path), old)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize(
    ("attributes", "sentence"),
    [
        ({"a": None}, "attribute 'a' is NoneType, expected numbers or a str"),
        ({"a": ["x", "y"]}, "attribute 'a' is list, expected numbers or a str"),
        ({"a": 2**64}, "attribute 'a' is int, expected numbers or a str"),
        ({"a": np.zeros(8000)}, "'a' has 64000 bytes, expected at most 60000; store it as an"),
    ],
)
def test_attribute_is_refused(path, attributes, sentence):
    with pytest.raises(ValueError, match=sentence):
        write_packing(path, nasty_packing(2), attributes)
    assert not path.exists()


@pytest.mark.parametrize("name", ["", "a/b", "."])
def test_observable_name_is_refused(path, name):
    with pytest.raises(ValueError, match=r"observable is named .*, expected a name without '/'"):
        write_packing(path, nasty_packing(2), observables={name: 1.0})


def test_run_comes_back_to_the_last_bit(path):
    run_of_three(path)
    assert count_frames(path) == 3
    for index, step in enumerate((0, 10, 20)):
        assert_identical(read_packing(path, index), frame(step))
        assert_identical(read_packing(path, index - 3), frame(step))


def test_observables_are_sampled_between_frames(path):
    run_of_three(path)
    p = read_series(path, "pressure")
    np.testing.assert_array_equal(p.step, [0, 5, 10, 15, 20])
    np.testing.assert_array_equal(p.time, np.array([0, 5, 10, 15, 20]) / 3)
    np.testing.assert_array_equal(p.value, [0, 10 / 7 - 1, 10 / 7, 20 / 7 - 1, 20 / 7])
    np.testing.assert_array_equal(read_observables(path)["pressure"], p.value)


def test_first_value_that_is_an_integer_makes_no_integer_series(path):
    writer = RunWriter.create(path, frame(0), observables={"pressure": 0})
    writer.append_observables(1, 1, {"pressure": 0.5})
    np.testing.assert_array_equal(read_observables(path)["pressure"], [0, 0.5])


def test_report_takes_one_row_or_many(path):
    writer = RunWriter.create(path, frame(0))
    assert len(read_report(path).step) == 0
    writer.append_report(0, 0.5, 1 / 3)
    writer.append_report([0, 7], [1.5, 2.5], [0.1, 0.01])
    report = read_report(path)
    np.testing.assert_array_equal(report.step, [0, 0, 7])
    np.testing.assert_array_equal(report.wall_seconds, [0.5, 1.5, 2.5])
    np.testing.assert_array_equal(report.error, [1 / 3, 0.1, 0.01])
    with pytest.raises(ValueError, match="steps decrease, expected ascending steps"):
        writer.append_report(6, 3, 0.001)
    with pytest.raises(ValueError, match="steps decrease, expected ascending steps"):
        writer.append_report([8, 7], [3, 4], [0.1, 0.1])


def test_resumed_run_equals_an_unbroken_one(path, tmp_path):
    run_of_three(path)
    writer = RunWriter.open(path)
    writer.truncate(12)
    assert count_frames(path) == 2
    np.testing.assert_array_equal(read_series(path, "pressure").step, [0, 5, 10])
    np.testing.assert_array_equal(read_report(path).step, [10])
    writer.append_observables(15, 5, {"pressure": 20 / 7 - 1})
    writer.append(frame(20), {"pressure": 20 / 7})
    writer.append_report(20, 20 / 11, 1 / 20)

    unbroken = tmp_path / "unbroken.h5"
    run_of_three(unbroken)
    for index in range(3):
        assert_identical(read_packing(path, index), read_packing(unbroken, index))
    for resumed, expected in (
        (read_series(path, "pressure"), read_series(unbroken, "pressure")),
        (read_report(path), read_report(unbroken)),
    ):
        for a, b in zip(resumed, expected, strict=True):
            np.testing.assert_array_equal(a, b)


def test_truncate_keeps_the_step_itself_and_the_first_frame(path):
    writer = run_of_three(path)
    writer.truncate(20)
    assert count_frames(path) == 3
    writer.truncate(0)
    assert count_frames(path) == 1
    with pytest.raises(ValueError, match="starts at step 0, expected to keep step -1"):
        writer.truncate(-1)


def test_set_attributes_replaces(path):
    writer = RunWriter.create(path, frame(0), {"finished": False, "kappa": 1e-6})
    writer.set_attributes({"finished": True, "phi_J": 0.84})
    assert read_attributes(path) == {"finished": True, "kappa": 1e-6, "phi_J": 0.84}


def test_file_is_closed_between_appends(path):
    writer = run_of_three(path)
    with h5py.File(path, "r+"):  # HDF5's lock would refuse this if the writer held the file
        pass
    assert_identical(read_packing(path), frame(20))
    writer.append(frame(30))
    assert count_frames(path) == 4


def test_run_survives_the_sudden_end_of_its_process(path):
    # os._exit as when LAMMPS's error->all ends the process
    script = (
        "import os, sys; path, *sys.path = sys.argv[1:]\n"
        "from test_h5md import run_of_three; run_of_three(path); os._exit(3)"
    )
    command = [sys.executable, "-c", script, str(path), *sys.path]
    assert subprocess.run(command, check=False).returncode == 3
    assert_identical(read_packing(path), frame(20))
    RunWriter.open(path).append(frame(30))
    assert count_frames(path) == 4


def test_rows_of_an_interrupted_append_are_overwritten(path):
    writer = run_of_three(path)
    with h5py.File(path, "r+") as file:
        for name in ("particles/all/position/value", "observables/pressure/value"):
            file[name].resize(len(file[name]) + 1, axis=0)
    assert count_frames(path) == 3
    assert len(read_observables(path)["pressure"]) == 5
    writer.append(frame(30), {"pressure": 1.0})
    assert_identical(read_packing(path), frame(30))
    assert read_observables(path)["pressure"][-1] == 1


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"step": 20}, "position is stored up to step 20, expected a step after it, found 20"),
        ({"id": np.arange(1, 7)}, "id differs from the first frame, expected the same particles"),
        ({"species": np.ones(6, int)}, "species differs from the first frame"),
        ({"diameters": np.ones((6, 3))}, "diameters differs from the first frame"),
        ({"shape_style": "superellipsoid"}, "shape_style differs from the first frame"),
    ],
)
def test_append_refuses_and_changes_nothing(path, changes, sentence):
    writer = run_of_three(path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=sentence):
        writer.append(frame(30).with_(**changes), {"pressure": 1.0})
    assert path.read_bytes() == before


def test_append_refuses_another_dimension(path):
    with pytest.raises(ValueError, match="dimension differs from the first frame"):
        run_of_three(path).append(nasty_packing(3))


def test_append_refuses_observables_and_changes_nothing(path):
    writer = run_of_three(path)
    before = read_series(path, "pressure").step
    with pytest.raises(
        ValueError, match="pressure is stored up to step 20, expected a step after it"
    ):
        writer.append_observables(20, 1, {"q": 1.0, "pressure": 1.0})
    with pytest.raises(ValueError, match=r"'pressure' is float64 \(2,\), expected float64 \(\) as"):
        writer.append(frame(30), {"pressure": np.zeros(2)})
    assert read_observables(path).keys() == {"pressure"}
    np.testing.assert_array_equal(read_series(path, "pressure").step, before)
    assert count_frames(path) == 3


def test_missing_file_is_an_oserror_that_names_it(path):
    with pytest.raises(FileNotFoundError, match=r"packing\.h5"):
        read_packing(path)


def test_missing_frame(path):
    run_of_three(path)
    for index in (3, -4):
        with pytest.raises(ValueError, match=f"has 3 frames, expected frame {index} to be one"):
            read_packing(path, index)


def test_text_is_not_hdf5(path):
    path.write_text("ITEM: TIMESTEP\n")
    with pytest.raises(FileFormatError, match=r"packing\.h5: is not an HDF5 file, expected one"):
        read_packing(path)


@pytest.mark.parametrize("part", [0.001, 0.25, 0.5, 0.99])
def test_truncated_file(path, part):
    run_of_three(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: max(16, int(part * len(whole)))])
    with pytest.raises(FileFormatError, match=r"packing\.h5: is truncated or damaged, expected a"):
        read_packing(path)


def test_damaged_inside(path):
    run_of_three(path)
    path.write_bytes(path.read_bytes().replace(b"OHDR", b"\0\0\0\0"))
    for read in (read_packing, read_attributes, read_observables, read_report, RunWriter.open):
        with pytest.raises(FileFormatError, match=r"packing\.h5: is truncated or damaged"):
            read(path)


def test_hdf5_that_is_not_h5md(path):
    with h5py.File(path, "w"):
        pass
    with pytest.raises(FileFormatError, match=r"packing\.h5: has no /h5md, expected an H5MD"):
        read_packing(path)


def test_other_version_of_h5md(path):
    write_packing(path, nasty_packing(2))
    with h5py.File(path, "r+") as file:
        file["h5md"].attrs["version"] = [2, 0]
    with pytest.raises(FileFormatError, match=r"has H5MD version \[2, 0\], expected \[1, 1\]"):
        read_packing(path)


@pytest.mark.parametrize("name", [*FRAME_ELEMENTS, "species", "id", "diameters"])
def test_missing_element(path, name):
    write_packing(path, nasty_packing(2))
    with h5py.File(path, "r+") as file:
        del file["particles/all"][name]
    with pytest.raises(FileFormatError, match=f"has no /particles/all/{name}") as error:
        read_packing(path)
    assert str(error.value).count(str(path)) == 1


def test_missing_observable(path):
    run_of_three(path)
    with pytest.raises(FileFormatError, match=r"packing\.h5: has no /observables/q/step"):
        read_series(path, "q")


def replace(file, name, value):
    del file[name]
    file[name] = value


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("diameters", np.ones((6, 2)), r"diameters has shape \(6, 2\), expected \(6, 3\)"),
        ("diameters", np.full((6, 3), np.nan), "diameters holds NaN or infinity"),
        ("position/value", np.full((1, 6, 2), np.inf), "position holds NaN or infinity"),
        ("position/value", np.zeros((1, 6, 3)), r"position has shape \(6, 3\), expected \(6, 2\)"),
        ("position/value", np.zeros((0, 6, 2)), r"shape \(0, 6, 2\), expected 1 rows"),
        ("position/value", 1.0, r"/particles/all/position/value has shape \(\), expected 1 rows"),
        ("position/step", 10, r"/particles/all/position/step has shape \(\), expected one step"),
        ("box/edges/value", -np.ones((1, 2)), r"box edges are \[-1.0, -1.0\], expected positive"),
        ("position/value", np.full((1, 6, 2), np.nan), "position holds NaN .*; write it again$"),
        ("position/value", np.zeros((1, 0, 2)), "packing has no particles, expected at least one"),
        ("orientation/value", np.full((1, 6), np.nan), "orientation holds NaN or infinity"),
        (
            "diameters",
            -np.ones((6, 3)),
            r"diameters hold -1\.0, expected positive lengths; write it",
        ),
        ("id", np.ones(6), "id has dtype float64, expected integers"),
        ("id", np.ones(6, int), "an id occurs more than once"),
    ],
)
def test_wrong_content(path, name, value, sentence):
    write_packing(path, nasty_packing(2))
    with h5py.File(path, "r+") as file:
        replace(file["particles/all"], name, value)
    with pytest.raises(FileFormatError, match=sentence) as error:
        read_packing(path)
    assert str(error.value).count(str(path)) == 1


@pytest.mark.parametrize("name", ["position_rest", "orientation_rest", "box/edges_rest"])
def test_rest_that_is_not_a_number(path, name):
    write_packing(path, with_rests(2))
    with h5py.File(path, "r+") as file:
        file["particles/all"][name]["value"][...] = np.nan
    sentence = rf"packing\.h5: {name.split('/')[-1]} holds NaN or infinity, expected finite numbers"
    with pytest.raises(FileFormatError, match=sentence):
        read_packing(path)


def test_group_in_the_place_of_a_dataset(path):
    write_packing(path, nasty_packing(2))
    with h5py.File(path, "r+") as file:
        del file["particles/all/id"]
        file.create_group("particles/all/id")
    with pytest.raises(FileFormatError, match="/particles/all/id is a group, expected a dataset"):
        read_packing(path)


REST_ELEMENTS = ("position_rest", "orientation_rest", "box/edges_rest")


def assert_same_poses(found, expected):
    for one, other in zip(found.poses(), expected.poses(), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("dimension", [2, 3])
def test_rests_come_back_to_the_last_bit(path, dimension):
    packing = with_rests(dimension)
    write_packing(path, packing)
    found = read_packing(path)
    assert_identical(found, packing)
    assert_same_poses(found, packing)
    for name in ("position_rest", "orientation_rest", "edges_rest"):
        assert getattr(found, name).tobytes() == getattr(packing, name).tobytes()
        assert getattr(found, name).any()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("make", [nasty_packing, with_rests])
def test_a_tilt_comes_back_to_the_last_bit(path, dimension, make):
    packing = make(dimension, box=tilted_box(dimension))
    write_packing(path, packing)
    found = read_packing(path)
    assert_identical(found, packing)
    assert_same_poses(found, packing)
    assert found.tilt_rest.any() == (make is with_rests)
    with h5py.File(path) as file:
        # H5MD: edge vectors are the rows.
        rows = file["particles/all/box/edges/value"][0]
    np.testing.assert_array_equal(rows, packing.box.matrix.T)
    assert rows[1].tolist()[:2] == [packing.box.tilt[0], packing.box.edges[1]]


@pytest.mark.parametrize("dimension", [2, 3])
def test_frames_with_and_without_a_tilt_are_in_one_file(path, dimension, tmp_path):
    plain, tilted = frame(0, dimension), frame(0, dimension).with_(box=tilted_box(dimension))
    fine = with_rests(dimension, box=tilted_box(dimension))
    frames = [
        one.with_(step=10 * k, time=k / 3)
        for k, one in enumerate([plain, plain, tilted, plain, fine, plain])
    ]
    writer = RunWriter.create(path, frames[0])
    for packing in frames[1:]:
        writer.append(packing)  # of the journal too, before they are folded
        assert_same_poses(read_packing(path), packing)
    writer.close()
    write_run(tmp_path / "other.h5", frames)
    for file in (path, tmp_path / "other.h5"):
        for k, packing in enumerate(frames):
            assert_identical(read_packing(file, k), packing)
            assert_same_poses(read_packing(file, k), packing)
        with h5py.File(file) as found:
            assert found["particles/all/box/edges/value"].shape == (6, dimension, dimension)
    writer = RunWriter.open(path)
    writer.truncate(10)
    writer.append(frames[2])
    writer.append(frames[3])
    writer.close()
    for k, packing in enumerate(frames[:4]):
        assert_same_poses(read_packing(path, k), packing)


def test_boxes_without_a_tilt_are_stored_by_their_edges(path):
    write_packing(path, nasty_packing(3))
    with h5py.File(path) as file:
        assert file["particles/all/box/edges/value"].shape == (1, 3)


def test_edge_vectors_that_are_turned_are_refused(path):
    write_packing(path, nasty_packing(2, box=tilted_box(2)))
    with h5py.File(path, "r+") as file:
        rows = file["particles/all/box/edges/value"]
        rows[0] = rows[0].T
    with pytest.raises(FileFormatError, match="expected the first one along x"):
        read_packing(path)


def test_packings_of_doubles_have_no_rests_in_their_files(path):
    write_packing(path, nasty_packing(2))
    with h5py.File(path) as file:
        assert not any(name in file["particles/all"] for name in REST_ELEMENTS)
    write_packing(path, with_rests(2))
    with h5py.File(path) as file:
        assert all(name in file["particles/all"] for name in REST_ELEMENTS)


def test_frames_with_rests_are_appended_and_truncated(path):
    frames = [with_rests(2).with_(step=step) for step in (0, 10, 20)]
    frames[1] = frames[1].with_(position=frames[1].position)  # without one of them
    writer = RunWriter.create(path, frames[0])
    for packing in frames[1:]:
        writer.append(packing)
    for index, packing in enumerate(frames):
        assert_same_poses(read_packing(path, index), packing)
    writer.truncate(10)
    assert count_frames(path) == 2
    assert_same_poses(read_packing(path), frames[1])
    writer.append(frames[2])
    assert_same_poses(read_packing(path), frames[2])


def test_rests_that_come_with_a_later_frame_are_not_lost(path):
    first = with_rests(2)
    writer = RunWriter.create(
        path,
        first.with_(step=0, position=first.position, orientation=first.orientation, box=first.box),
    )
    later = first.with_(step=10)
    writer.append(later)
    assert_same_poses(read_packing(path), later)


def test_a_series_is_as_many_rows_one_by_one(path, tmp_path):
    steps, times = np.array([5, 7, 20]), np.array([5, 7, 20]) / 3
    columns = {"pressure": np.array([1 / 3, np.nan, -0.0]), "u": np.array([1e-300, 2, 3])}
    together, single = (RunWriter.create(p, frame(0)) for p in (path, tmp_path / "single.h5"))
    together.append_series(steps[:2], times[:2], {k: v[:2] for k, v in columns.items()})
    together.append_series(steps[2:], times[2:], {k: v[2:] for k, v in columns.items()})
    together.append_series([], [], {"pressure": []})
    for row, (step, time) in enumerate(zip(steps, times, strict=True)):
        single.append_observables(step, time, {k: v[row] for k, v in columns.items()})
    for name in columns:
        one, other = read_series(together.path, name), read_series(single.path, name)
        for x, y in zip(one, other, strict=True):
            assert (x.dtype, x.tobytes()) == (y.dtype, y.tobytes())


@pytest.mark.parametrize(
    ("steps", "times", "p", "sentence"),
    [
        ([21, 22], [1, 2], [1], r"rows of a series differ in length, expected \(2,\)"),
        ([21, 22], [1], [1, 2], r"rows of a series differ in length, expected \(2,\)"),
        ([22, 21], [1, 2], [1, 2], "the steps of a series do not ascend"),
        ([21, 21], [1, 2], [1, 2], "the steps of a series do not ascend"),
        (
            [20, 21],
            [1, 2],
            [1, 2],
            "pressure is stored up to step 20, expected a step after it, found 20",
        ),
    ],
)
def test_series_is_refused_and_changes_nothing(path, steps, times, p, sentence):
    writer = run_of_three(path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=sentence):
        writer.append_series(steps, times, {"pressure": p})
    assert path.read_bytes() == before


def test_a_reader_finds_the_half_lengths_and_radii_that_contacts_are_computed_with(path):
    """Not to be had from 2(A + R), which is rounded."""
    packing = nasty_packing(2)
    write_packing(path, packing)
    with h5py.File(path) as file:
        group = file["particles/all"]
        np.testing.assert_array_equal(group["half_length"], packing.half_length)
        np.testing.assert_array_equal(2 * group["radius"][()], packing.diameters[:, 1])


def test_rests_of_other_doubles_are_left_out(tmp_path):
    """After another program has changed units, they are no digits of its numbers."""
    packing = with_rests(2)
    write_packing(tmp_path / "fine.h5", packing)
    with h5py.File(tmp_path / "fine.h5", "a") as file:
        for name in ("position", "box/edges"):
            file[f"particles/all/{name}/value"][...] *= 2.0**-20
    found = read_packing(tmp_path / "fine.h5")
    assert (found.position == packing.position * 2.0**-20).all()
    assert not found.position_rest[found.position != 0].any()
    assert not found.edges_rest.any()
    assert (found.orientation_rest == packing.orientation_rest).all()


def test_two_copies_of_a_size_that_disagree_are_refused(tmp_path):
    write_packing(tmp_path / "rods.h5", nasty_packing(2))
    with h5py.File(tmp_path / "rods.h5", "a") as file:
        file["particles/all/radius"][2] *= 1.1
    with pytest.raises(FileFormatError, match="radius differs from that of diameters"):
        read_packing(tmp_path / "rods.h5")
