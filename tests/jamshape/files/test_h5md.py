import subprocess
import sys
import warnings

import numpy as np
import pytest
from nasty import assert_identical, nasty_packing, tilted_box, with_rests
from written import write_content

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
    rows = [(0, 0.0, {"pressure": 0.0})]
    for step in (10, 20):
        rows.append((step - 5, (step - 5) / 3, {"pressure": step / 7 - 1}))
        rows.append((step, step / 3, {"pressure": step / 7}))
    report = [(step, step / 11, 1 / step) for step in (10, 20)]
    return write_content(path, [frame(step) for step in (0, 10, 20)], rows=rows, report=report)


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
    rows = [(0, 0.0, {"pressure": 0.5}), (10, 10 / 3, {"pressure": 0.75})]
    write_content(path, frames, {"kappa": 1e-6}, rows)
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
    write_content(path, [frame(0)], rows=[(0, 0.0, {"pressure": 0}), (1, 1.0, {"pressure": 0.5})])
    np.testing.assert_array_equal(read_observables(path)["pressure"], [0, 0.5])


def test_run_survives_the_sudden_end_of_its_process(path):
    # os._exit as when LAMMPS's error->all ends the process
    script = (
        "import os, sys; path, *sys.path = sys.argv[1:]\n"
        "from test_h5md import run_of_three; run_of_three(path); os._exit(3)"
    )
    command = [sys.executable, "-c", script, str(path), *sys.path]
    assert subprocess.run(command, check=False).returncode == 3
    assert_identical(read_packing(path), frame(20))
    assert count_frames(path) == 3


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
    content = run_of_three(path)
    with pytest.raises(ValueError, match=sentence):
        content.add_frame(frame(30).with_(**changes))
    assert len(content.frames) == 3


def test_append_refuses_another_dimension(path):
    with pytest.raises(ValueError, match="dimension differs from the first frame"):
        run_of_three(path).add_frame(nasty_packing(3))


def test_append_refuses_observables_and_changes_nothing(path):
    content = run_of_three(path)
    with pytest.raises(
        ValueError, match="pressure is stored up to step 20, expected a step after it"
    ):
        content.add_row(20, 1.0, {"q": 1.0, "pressure": 1.0})
    with pytest.raises(ValueError, match=r"'pressure' is float64 \(2,\), expected float64 \(\) as"):
        content.add_row(30, 10.0, {"pressure": np.zeros(2)})
    assert content.columns.keys() == {"pressure"}
    assert content.columns["pressure"].steps == [0, 5, 10, 15, 20]


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
    for read in (read_packing, read_attributes, read_observables, read_report):
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
def test_frames_with_and_without_a_tilt_are_in_one_file(path, dimension):
    plain, tilted = frame(0, dimension), frame(0, dimension).with_(box=tilted_box(dimension))
    fine = with_rests(dimension, box=tilted_box(dimension))
    frames = [
        one.with_(step=10 * k, time=k / 3)
        for k, one in enumerate([plain, plain, tilted, plain, fine, plain])
    ]
    write_run(path, frames)
    for k, packing in enumerate(frames):
        assert_identical(read_packing(path, k), packing)
        assert_same_poses(read_packing(path, k), packing)
    with h5py.File(path) as found:
        assert found["particles/all/box/edges/value"].shape == (6, dimension, dimension)


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


def test_rests_that_come_with_a_later_frame_are_not_lost(path):
    first = with_rests(2)
    plain = {"position": first.position, "orientation": first.orientation, "box": first.box}
    later = first.with_(step=10)
    write_run(path, [first.with_(step=0, **plain), later])
    assert_same_poses(read_packing(path), later)


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
