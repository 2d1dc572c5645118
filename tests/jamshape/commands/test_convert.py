"""``jamshape convert`` on files of 0.1.0 and of before, which all else refuses (`earlier/README.md`)."""

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest

import jamshape as js
from jamshape.commands.earlier import renamed
from jamshape.exchange.gsd import read_gsd, read_gsd_clock
from jamshape.files.disk import FileFormatError
from jamshape.files.h5md import (
    read_attributes,
    read_origin,
    read_packing,
    read_series,
    write_packing,
    write_run,
)
from jamshape.files.lock import Lock
from jamshape.files.vocabulary import FORMAT_VERSION
from jamshape.measures.jamming import Jamming
from jamshape.protocols.defaults import PROTOCOLS
from jamshape.protocols.random_start import random_packing
from jamshape.vibration.ensembles import key_of, of_packing
from jamshape.vibration.table import ERRORS, read_modes

EARLIER = Path(__file__).parent / "earlier"
FILES = sorted(str(path.relative_to(EARLIER).with_suffix("")) for path in EARLIER.glob("*/*.gz"))
ORIGIN = "x86_64; glibc"  # where files of after 0.1.0 were made

KINDS = {
    "aqs": ("quasistatic shear", "QuasistaticShearFile"),
    "compress": ("compression", "RunFile"),
    "modes": ("modes", "Modes"),
    "packing": ("packing", "Packing"),
    "shear": ("shear", "ShearFile"),
    "slow": ("slow compression", "RunFile"),
}


def unpacked(name, folder):
    """Return a file as it was written."""
    path = folder / Path(name).name
    path.write_bytes(gzip.decompress((EARLIER / f"{name}.gz").read_bytes()))
    return path


def content(path):
    """All numbers and texts of an HDF5 file, by the names of today."""
    found = {}

    def add(group):
        for name, item in group.items():  # `visititems` leaves out further links
            if isinstance(item, h5py.Group):
                add(item)
            else:
                found[f"{group.name}/{name}"] = np.atleast_1d(item[()])

    with h5py.File(path) as file:
        add(file)
        for name, value in file["parameters"].attrs.items():
            found[f"/parameters/{name}"] = value
        if "particles" in file:
            found["shape_style"] = file["particles/all"].attrs["shape_style"]
    return found


def plain(value):
    return value.decode() if isinstance(value, bytes) else value


def aged(path, version=2):
    """Make a file of today one of before in what its format version says."""
    with h5py.File(path, "r+") as file:
        attributes = file["h5md/creator"].attrs
        del attributes["origin"]
        attributes["format_version"] = version
        if version == 1:
            del attributes["format_version"]


@pytest.fixture
def packing():
    return random_packing(8, 0.1, 1)


@pytest.mark.parametrize("name", FILES)
def test_all_else_refuses_earlier_files(jamshape, tmp_path, name):
    if name.endswith("gsd"):
        pytest.importorskip("gsd")
    path = unpacked(name, tmp_path)
    said = (
        f"{path} was written by jamshape 0.1.0 (format 2), expected format {FORMAT_VERSION};"
        f" run jamshape convert {path}"
    )
    for read in (js.load, *([lambda path: js.frames(path)[-1]] if "modes" not in name else ())):
        with pytest.raises(FileFormatError) as error:
            read(path)
        assert str(error.value) == said
    assert jamshape("info", path).code == f"jamshape info: {said}"


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".h5")])
def test_a_file_is_replaced_by_one_of_today_with_the_same_numbers(jamshape, tmp_path, name):
    path = unpacked(name, tmp_path)
    path.chmod(0o640)
    before, (kind, opens) = content(path), KINDS[path.stem]
    ended = jamshape("convert", path)
    assert ended.out.splitlines()[0] == f"{path}: {kind}, converted from format 2 to 3"
    row = {"file": str(path), "out": str(path), "converted": True}
    row |= {"kind": kind, "version": 2, "finished": True}
    assert ended.report == {"files": [row], "converted": 1}
    if kind == "modes":  # rounding errors of modes that have none
        still = before["/modes/is_translation"]
        for column in ("eigenvalues", "omega", *ERRORS):
            before[f"/modes/{column}"][still] = 0
    after, gone = content(path), {"direct": "extrapolation"}
    for old, value in before.items():
        new = old.replace("packing_way", "packing_protocol").replace("/way", "/protocol")
        wanted = gone.get(value, value) if isinstance(value, str) else value
        np.testing.assert_array_equal(plain(after[new]), wanted, err_msg=new)
        assert np.asarray(after[new]).dtype.kind in {np.asarray(wanted).dtype.kind, "O", "S"}
    assert path.stat().st_mode & 0o777 == 0o640
    assert type(js.load(path)).__name__ == opens
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    data = path.read_bytes()
    assert jamshape("convert", path).out.splitlines()[0] == f"{path}: has format 3 already"
    assert path.read_bytes() == data


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".h5")])
def test_a_converted_file_has_all_that_one_of_today_has(jamshape, tmp_path, name):
    path = unpacked(name, tmp_path)
    jamshape("convert", path)
    assert path.read_bytes()[8] == 3  # superblock with a checksum
    with h5py.File(path) as file:
        file.visititems(lambda _, x: isinstance(x, h5py.Group) or x.fletcher32 or pytest.fail(x))
    if path.stem == "modes":
        return
    assert read_packing(path, 0).law == js.Interaction()
    assert read_origin(path).startswith(ORIGIN) == name.startswith("before_kinds")
    assert bool(read_origin(path)) == name.startswith("before_kinds")
    known = read_attributes(path)
    assert known.get("kind", "packing") == KINDS[path.stem][0]
    if "kind" in known:
        assert (known["dimension"], known["k_e"], known["sides"]) == (2, 1, 2)
        assert js.resume(path, progress=False).about["finished"]


def test_a_converted_packing_is_that_of_its_recipe(jamshape, tmp_path):
    path = unpacked("0.1.0/packing.h5", tmp_path)
    jamshape("convert", path)
    rods, data = js.Spherocylinders(alpha=1), path.read_bytes()
    found = js.make_packing(rods, n=4, u0=1e-6, file=path, progress=False)
    assert found.results["search"] == "extrapolation"
    assert path.read_bytes() == data
    assert found.u == pytest.approx(1e-6, rel=1e-6)


def test_copies_leave_the_files(jamshape, tmp_path):
    paths = [unpacked(f"0.1.0/{name}.h5", tmp_path) for name in ("packing", "shear")]
    write_packing(tmp_path / "today.h5", random_packing(4, 0.1, 1))
    paths.append(tmp_path / "today.h5")
    before, out = [path.read_bytes() for path in paths], tmp_path / "a" / "b"
    ended = jamshape("convert", *paths, "--out", out)
    assert [path.read_bytes() for path in paths] == before
    assert [row["converted"] for row in ended.report["files"]] == [True, True, False]
    assert (out / "today.h5").read_bytes() == before[-1]
    assert {p.name for p in out.iterdir()} == {path.name for path in paths}
    assert js.load(out / "shear.h5").about["finished"]
    code = jamshape("convert", *paths, "--out", out).code
    assert f"{out / 'packing.h5'} exists, expected --out to be a folder without it" in code
    code = jamshape("convert", paths[0], out / "packing.h5", "--out", tmp_path / "c").code
    assert "2 files are called packing.h5, expected one to be written to" in code
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize("has_journal", [False, True])
def test_an_unfinished_run_stays_so_and_is_not_resumed(jamshape, tmp_path, has_journal):
    path = unpacked("0.1.0/slow.h5", tmp_path)
    with h5py.File(path, "r+") as file:
        file["parameters"].attrs["finished"] = False
    journal = tmp_path / "slow.h5.journal"
    if has_journal:
        journal.write_bytes(b"jamshape journal 1\n")
    ended = jamshape("convert", path)
    left = f", without the rows in {journal}" if has_journal else ""
    assert ended.out.splitlines()[0].endswith(
        f"to 3{left}; it is not finished and cannot be resumed, repeat its command with --again"
    )
    assert not ended.report["files"][0]["finished"]
    assert not js.load(path).about["finished"]
    with pytest.raises(FileFormatError, match="interrupted in another version of jamshape"):
        js.resume(path, progress=False)


def test_names_of_before_0_1_0(jamshape, tmp_path, packing):
    path = tmp_path / "old.h5"
    old = {"p": 1.5, "w1": 1.0, "w2": 1.0, "protocol": 1, "outcome": "corner"}
    write_packing(path, packing, old, {"p": 1e-6})
    aged(path, version=1)
    with pytest.raises(FileFormatError, match=r"\(format 1\), expected format 3"):
        read_attributes(path)
    assert jamshape("convert", path).report["files"][0]["version"] == 1
    new = {"exponent": 1.5, "w1": 1.0, "w2": 1.0, "protocol": "yuan-2019-1", "outcome": "kink"}
    assert read_attributes(path) == new
    assert read_series(path, "pressure").value == [1e-6]


def test_names_and_values_are_todays_and_todays_stay():
    assert renamed({"p": 1e-8, "alpha": 4.0}) == {"pressure": 1e-8, "alpha": 4.0}
    old = {"p": 1.5, "w1": 1.0, "w2": 1.0, "pressure": 1e-6}
    new = {"exponent": 1.5, "w1": 1.0, "w2": 1.0, "pressure": 1e-6}
    assert renamed(old) == renamed(renamed(old)) == renamed(new) == new
    assert set(PROTOCOLS) >= {"quasistatic", "dynamics", "steps"}
    old = {"way": "quasistatic", "outcome": "corner", "search": "halving", "method": "paper"}
    new = {"protocol": "quasistatic", "outcome": "kink", "search": "bisection"}
    assert renamed(old) == new | {"method": "cg_marschall"}


@pytest.mark.parametrize(("told", "law"), [({"k_e": 2.0, "sides": 1}, (2, 1, 2)), ({}, (1, 2, 2))])
def test_the_law_was_among_attributes_or_nowhere(jamshape, tmp_path, packing, told, law):
    path = tmp_path / "old.h5"
    write_run(path, [packing, packing.with_(step=1)], told)
    aged(path)
    with h5py.File(path, "r+") as file:
        for name in packing.law.stated():
            del file["particles/all"].attrs[name]
    jamshape("convert", path)
    assert [read_packing(path, k).law for k in (0, 1)] == [law, law]


MARKS = {
    "packing in the making": ["search_step", "strict_search", "retry_budget", "loose_phi"],
    "compression for a packing": ["restart_step", "of_packing"],
    "slow compression": ["flow_steps"],
    "quasistatic shear": ["shear_steps"],
    "shear": ["gdot"],
    "compression": ["finished"],
}


@pytest.mark.parametrize(("kind", "mark"), [(k, mark) for k in MARKS for mark in MARKS[k]])
def test_kinds_are_those_of_the_marks(jamshape, tmp_path, packing, kind, mark):
    path = tmp_path / "old.h5"
    write_packing(path, packing, {mark: 1})
    aged(path)
    assert jamshape("convert", path).report["files"][0]["kind"] == kind
    assert (read_attributes(path)["kind"], read_attributes(path)["sides"]) == (kind, 2)
    assert bool(read_attributes(path)["finished"]) == (mark == "finished")


def test_a_slow_shear_is_told_from_a_compression_and_a_stated_kind_stays(
    jamshape, tmp_path, packing
):
    for attributes in ({"flow_steps": 1, "gdot": 1e-8}, {"kind": "slow shear"}):
        write_packing(tmp_path / "old.h5", packing, attributes)
        aged(tmp_path / "old.h5")
        jamshape("convert", tmp_path / "old.h5")
        assert read_attributes(tmp_path / "old.h5")["kind"] == "slow shear"


def test_frames_that_were_not_counted_as_undecided_are_none(jamshape, tmp_path, packing):
    path = tmp_path / "old.h5"
    write_packing(path, packing, {"phi_unjams": 0.5, "phi_jams": 0.52, "frames_minimised": 3})
    aged(path)
    jamshape("convert", path)
    assert Jamming.stored(read_attributes(path)) == Jamming(0.5, 0.52, 3, 0)


def test_modes_without_the_numbers_of_today(jamshape, tmp_path):
    path = unpacked("0.1.0/modes.h5", tmp_path)
    with h5py.File(path, "r+") as file:
        del file["modes/overlap_error"], file["parameters"].attrs["n_translations"]
        del file["parameters"].attrs["packing_shape"]
        file["parameters"].attrs["packing_protocol"] = 1
        del file["parameters"].attrs["packing_way"]
        moving = np.flatnonzero(file["modes/is_translation"][()])
        values = file["modes/eigenvalues"][()]
        values[moving] = 1e-20
        file["modes/eigenvalues"][...] = values
    jamshape("convert", path)
    table = read_modes(path)
    assert (table["overlap_error"] == 0).all()
    assert (table["eigenvalues"][moving] == 0).all()
    assert (table.n_vibrational, len(moving)) == (10, 2)
    system = key_of(table).system
    assert (system.shape, system.protocol) == ("spherocylinder", "yuan-2019-1")
    moduli = table.moduli
    assert moduli.bulk.relaxed == table.attributes["bulk_modulus"]
    assert moduli.bulk.bound == np.inf
    assert (moduli.n_floppy, moduli.n_unsettled, moduli.n_negative) == (0, 0, 0)
    assert "the file has no elastic tensors" in moduli.B["xyxy"].reason
    assert np.isnan(moduli.B.G_dc.relaxed)
    assert moduli.is_stable_to_shear is None
    assert js.Interaction.told(of_packing(table)) == js.Interaction()
    assert {"k_e", "sides"} <= of_packing(table).keys()


def test_gsd(jamshape, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    path = unpacked("0.1.0/discs.gsd", tmp_path)
    path.chmod(0o640)
    with hoomd.open(str(path)) as file:
        before = [(frame.log, frame.particles.position.copy()) for frame in file]
    ended = jamshape("convert", path)
    assert ended.out.splitlines()[0] == f"{path}: GSD file, converted from format 2 to 3"
    with hoomd.open(str(path)) as file:
        for (log, position), frame in zip(before, file, strict=True):
            np.testing.assert_array_equal(frame.particles.position, position)
            for name, value in log.items():
                np.testing.assert_array_equal(frame.log[name], value)
    steps, times = read_gsd_clock(path)
    assert (steps.tolist(), times.tolist()) == ([0, 5], [0, 1.5])
    assert read_gsd(path).law == js.Interaction()
    assert path.stat().st_mode & 0o777 == 0o640
    data = path.read_bytes()
    assert not jamshape("convert", path).report["converted"]
    assert path.read_bytes() == data


def test_what_is_not_converted_is_refused_and_left(jamshape, tmp_path, packing):
    path = tmp_path / "file.h5"

    def refused(words):
        data = path.read_bytes()
        assert words in jamshape("convert", path).code
        assert path.read_bytes() == data

    path.write_bytes(b"ITEM: TIMESTEP\n0\n")
    refused("has no format that jamshape converts, expected a packing, a run or modes in HDF5")
    for name, value, words in (
        ("format_version", 4, "(format 4), expected format 3; read it with that version"),
        ("name", np.bytes_("others"), "was written by others, expected a file of jamshape"),
    ):
        write_packing(path, packing)
        with h5py.File(path, "r+") as file:
            file["h5md/creator"].attrs[name] = value
        refused(words)
    path = unpacked("0.1.0/shear.h5", tmp_path)
    with Lock(path):
        refused("another process writes this file")
    path.write_bytes(path.read_bytes()[:30000])
    refused("is truncated or damaged")
