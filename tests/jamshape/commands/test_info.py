"""``jamshape info`` on every kind of file."""

import gzip

import h5py
import numpy as np
import pytest

from jamshape.files.h5md import read_attributes, read_packing, write_packing
from jamshape.files.lammps_text import write_data
from jamshape.lammps.session import Session
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing

pytestmark = pytest.mark.lammps


def info(jamshape, path, *more):
    """Return the report on a file: the lines by their subjects, and the last one."""
    ended = jamshape("info", path, *more)
    assert not ended.code
    first, *lines, _ = ended.out.splitlines()
    assert first.startswith(f"{path}: {ended.report['kind']}")
    return dict(map(str.strip, line.split(":", 1)) for line in lines), ended.report


@pytest.mark.parametrize(
    ("name", "rate", "made"),
    [
        ("packing.h5", (), "seed 1, u0 1e-06, protocol quasistatic, phi from 0.55"),
        ("dynamics.h5", ("kappa",), "seed 1, kappa 1e-05, u0 1e-06, phi from 0.55"),
    ],
)
def test_a_packing(jamshape, tiny, name, rate, made):
    path = tiny[0] / name
    lines, report = info(jamshape, path)
    stored = read_attributes(path)
    assert (report["kind"], report["finished"], report["reached"]) == ("packing", True, True)
    assert set(rate) == {"kappa"} & report.keys()
    known = ("phi", "pressure", "u", "z", "z_single", "z_iso", "seed", *rate, "u0", "wall_seconds")
    for told in known:
        assert report[told] == stored[told]
    assert (report["S_2"], report["S_4"]) == (stored["S2"], stored["S4"])
    assert lines["order"] == f"S_2 {stored['S2']:.4g}, S_4 {stored['S4']:.4g}"
    assert "C_4" not in report
    assert report["rattlers"] == stored["n_rattlers"]
    assert report["error"] == stored["residual"]
    kind = {"alpha": pytest.approx(1.0), "count": 8}
    assert report["kinds"] == [kind | {"size": 1.0}, kind | {"size": 1.4}]
    assert lines["particles"].startswith("16 spherocylinders in 2D, 8 with alpha 1, 2R = 1; 8 with")
    assert lines["made with"] == made
    assert "format 3" in lines["written by"]
    assert "continue with" not in lines


def test_a_tilt_is_told(jamshape, tmp_path):
    packing = random_packing(8, 0.1, 1)
    write_packing(tmp_path / "plain.h5", packing)
    lines, report = info(jamshape, tmp_path / "plain.h5")
    assert "tilt" not in report
    assert "tilt" not in lines["box"]
    tilted = packing.with_(box=Box(packing.box.lo, [60, 65], [-2.5]))
    write_packing(tmp_path / "tilted.h5", tilted)
    lines, report = info(jamshape, tmp_path / "tilted.h5")
    assert (report["box"], report["tilt"]) == ([60, 65], [-2.5])
    assert lines["box"] == "60 x 65, tilt -2.5"


def test_a_packing_of_which_nothing_is_known_is_measured(jamshape, tiny, tmp_path):
    stored = read_attributes(tiny[0] / "packing.h5")
    packing = read_packing(tiny[0] / "packing.h5")
    write_packing(tmp_path / "bare.h5", packing)
    write_data(tmp_path / "bare.data", packing)
    for name in ("bare.h5", "bare.data"):
        _, report = info(jamshape, tmp_path / name)
        assert report["phi"] == pytest.approx(stored["phi"], rel=1e-12)
        assert report["u"] == pytest.approx(1e-6, rel=1e-6)
        assert report["pressure"] == pytest.approx(stored["pressure"], rel=1e-6)
        assert (report["z"], report["rattlers"]) == (stored["z"], stored["n_rattlers"])
        assert report["z_single"] == stored["z_single"]
        assert report["S_2"] == pytest.approx(stored["S2"], rel=1e-12)


@pytest.mark.parametrize(
    ("name", "kind"), [("run.h5", "compression"), ("slow.h5", "slow compression")]
)
def test_a_run(jamshape, tiny, name, kind):
    lines, report = info(jamshape, tiny[0] / name)
    said = tiny[1][name].report
    assert (report["kind"], report["finished"]) == (kind, True)
    assert (report["phi"], report["pressure"]) == (said["phi"], said["pressure"])
    assert report["frames"] >= 2
    assert f"{report['frames']} frames" in lines["holds"]
    assert "kappa" in lines["made with"]
    assert report["wall_seconds"] > 0


@pytest.mark.parametrize(
    ("name", "stored", "words"),
    [
        ("run.h5", {"finished": False}, "repeat the command that began it"),
        ("slow.h5", {"finished": False}, "repeat the command that began it"),
        (
            "dynamics.h5.run.h5",
            {"finished": False},
            "repeat the command for {folder}/dynamics.h5, which continues",
        ),
        (
            "packing.h5.making.h5",
            {"kind": "packing in the making", "finished": False},
            "the command for {folder}/packing.h5, which continues",
        ),
    ],
)
def test_what_is_not_finished_says_how_to_continue(jamshape, tiny, tmp_path, name, stored, words):
    source, path = tiny[0] / name, tmp_path / name
    if source.exists():
        path.write_bytes(source.read_bytes())
    else:
        write_packing(path, read_packing(tiny[0] / "packing.h5"))
    with h5py.File(path, "r+") as file:
        file["parameters"].attrs.update(stored)
    lines, report = info(jamshape, path)
    assert not report["finished"]
    assert words.format(path=path, folder=tmp_path) in report["go_on"]
    assert lines["continue with"] == report["go_on"]


def test_modes(jamshape, tiny):
    lines, report = info(jamshape, tiny[0] / "modes.h5")
    said = tiny[1]["modes.h5"].report
    assert (report["modes"], report["n_modes"]) == (said["n_modes"], said["n_modes"])
    assert sum(report["bands"].values()) == said["n_modes"] - said["n_translations"]
    for name in ("bulk_modulus", "B_G_dc", "bordered_eigenvalue", "is_stable_to_shear"):
        assert report[name] == said[name]
    assert report["is_stable_to_shear"] in {True, False}
    stable = "stable" if report["is_stable_to_shear"] else "unstable"
    assert lines["moduli"].endswith(f", {stable} to shear")
    assert report["seed"] == 1
    assert lines["particles"].startswith("16 spherocylinders in 2D")


COLUMNS = {
    "c_orient[1]": "quatw", "c_orient[2]": "quati", "c_orient[3]": "quatj", "c_orient[4]": "quatk",
    "c_shape[1]": "shapex", "c_shape[2]": "shapey", "c_shape[3]": "shapez",
}  # fmt: skip


def test_dumps_and_restart_files_of_lammps(jamshape, tiny, tmp_path):
    packing = read_packing(tiny[0] / "packing.h5")
    dump, restart = tmp_path / "my.dump", tmp_path / "my.restart"
    with Session() as session:
        session.load(packing)
        session.commands(f"""
            pair_style spherocylinder/harmonic sides two
            pair_coeff * * 1.0
            dump all all custom 1 {dump} id type x y z {" ".join(COLUMNS)}
            dump_modify all sort id format float %.17g
            run 0
            undump all
            reset_timestep 7
            write_restart {restart}
        """)
    text = dump.read_text()
    for given, known in COLUMNS.items():
        text = text.replace(given, known)
    dump.write_text(text * 3)
    _, report = info(jamshape, dump, "--shape", "spherocylinder", "--dimension", "2")
    assert (report["kind"], report["frames"], report["n"]) == ("LAMMPS dump", 3, 16)
    assert report["phi"] == pytest.approx(packing.phi, rel=1e-12)
    packed = tmp_path / "packed.gz"
    packed.write_bytes(gzip.compress(dump.read_bytes()))
    _, again = info(jamshape, packed, "--shape", "spherocylinder", "--dimension", "2")
    assert again == report | {"file": str(packed)}
    lines, report = info(jamshape, restart)
    assert (report["kind"], report["step"], report["dimension"]) == ("LAMMPS restart file", 7, 2)
    assert report["lammps"][-4:].isdigit()
    assert f"-var restart {restart}" in lines["continue with"]


def test_what_a_data_file_does_not_say_is_said_by_options(jamshape, tiny, tmp_path, capsys):
    packing = read_packing(tiny[0] / "packing.h5")
    write_data(tmp_path / "bare.data", packing)
    text = (tmp_path / "bare.data").read_text().replace("-0.5 0.5 zlo", "-3 3 zlo")
    (tmp_path / "bare.data").write_text("of another program\n" + text.split("\n", 1)[1])
    said = "--shape", "dimer", "--dimension", "2"
    _, report = info(jamshape, tmp_path / "bare.data", *said)
    assert (report["shape"], report["dimension"]) == ("dimer", 2)
    for command, out in (("draw", "p.png"), ("export", "p.h5")):
        ended = jamshape(command, tmp_path / "bare.data", *said, "--out", tmp_path / out)
        assert (ended.report["shape"], ended.report["dimension"]) == ("dimer", 2)
    refused = jamshape("info", tiny[0] / "packing.h5", *said).code
    assert "has shape spherocylinder, expected --shape to be the same; leave it out" in refused
    capsys.readouterr()


def test_gsd(jamshape, tiny, tmp_path):
    pytest.importorskip("gsd.hoomd")
    jamshape("export", tiny[0] / "run.h5", "--out", tmp_path / "run.gsd")
    _, report = info(jamshape, tmp_path / "run.gsd")
    assert (report["kind"], report["n"]) == ("GSD file", 16)
    assert report["phi"] == pytest.approx(tiny[1]["run.h5"].report["phi"], rel=1e-12)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is empty, expected"),
        (b"notes\n", "has no known format, expected"),
        (bytes(range(256)), "has no known format, expected"),
        (
            gzip.compress(b"notes", mtime=0),
            "is compressed, expected the file itself; unpack it with gunzip",
        ),
    ],
)
def test_what_is_none_of_ours_is_one_sentence(jamshape, tmp_path, content, sentence):
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    said = jamshape("info", path).code
    assert said.startswith(f"jamshape info: {path} {sentence}")
    assert "\n" not in said


def test_other_hdf5_and_what_is_not_there_is_one_sentence(jamshape, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = np.arange(3)
    for name, words in (("other.h5", "expected an H5MD file"), ("none.h5", "No such file")):
        said = jamshape("info", tmp_path / name).code
        assert said.startswith("jamshape info: ")
        assert words in said
