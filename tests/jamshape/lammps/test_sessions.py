"""Sessions that are closed, cleared, loaded twice or given other arguments; commands over several lines."""

import numpy as np
import pytest

import jamshape as js
from jamshape.front.packing import public
from jamshape.lammps.module import separate_commands
from jamshape.lammps.session import Session
from jamshape.protocols.random_start import random_packing

HARMONIC = "pair_style spherocylinder/harmonic sides two\npair_coeff * * 1.0"


def start(n=8):
    return random_packing(n=n, phi=0.3, seed=1)


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        ("units lj\n\n  run 0  ", ["units lj", "", "run 0"]),
        ("run &\n 0\nrun 1", ["run  0", "run 1"]),
        ("a &  \n b &\n c", ["a  b  c"]),
        ('print """a\n  b"""\nrun 0', ['print """a\n  b"""', "run 0"]),
        ('print """a"""', ['print """a"""']),
        ("run &", ["run"]),
        ("", []),
    ],
)
def test_commands_are_continued_as_in_decks(text, commands):
    assert separate_commands(text) == commands


@pytest.mark.lammps
def test_a_session_runs_continued_commands(tmp_path):
    with Session(log=tmp_path / "a.log") as session:
        session.commands(
            'variable a equal &\n 1+2\nvariable b string """x\ny"""\nprint "sum $a ${b}"'
        )
    assert "sum 3 x\ny" in (tmp_path / "a.log").read_text()


@pytest.mark.lammps
@pytest.mark.parametrize(
    "use",
    [
        js.load,
        lambda session: public(start()).to_lammps(session),
        lambda session: session.commands("run 0"),
        lambda session: session.load(start()),
        lambda session: session.interact(js.Interaction()),
        lambda session: session.lmp.get_natoms(),
        lambda session: session.packing(),
        lambda session: session.restart(),
        lambda session: session.left_out(),
        lambda session: session.step,
    ],
)
def test_a_closed_session_is_refused(use):
    with Session() as session:
        session.load(start())
    session.close()
    with pytest.raises(
        ValueError,
        match=r"^the session is closed, expected an open one; make a new js\.Session\(\)$",
    ):
        use(session)


@pytest.mark.lammps
def test_a_closed_instance_is_refused():
    with Session() as session:
        session.load(start())
        instance = session.lmp
    with pytest.raises(ValueError, match=r"^the LAMMPS instance is closed, expected an open one"):
        js.load(instance)


@pytest.mark.lammps
@pytest.mark.parametrize("clear", ["clear", "if 1 then clear"])
def test_a_cleared_session_has_its_styles_and_takes_another_packing(clear):
    with Session() as session:
        session.load(start())
        session.interact(js.Interaction(3.0))
        session.commands(clear)
        with pytest.raises(ValueError, match="no packing was loaded"):
            session.interact(js.Interaction())
        session.load(start(n=9))
        session.commands(f"{HARMONIC}\nrun 0")
        assert session.packing().n == 9
        assert session.packing().law == start().law
        assert js.load(session).law == js.Interaction(1.0, 2)


@pytest.mark.lammps
def test_a_session_takes_one_packing():
    with Session() as session:
        session.load(start())
        position = session.packing().position
        for load in (
            lambda: session.load(start()),
            lambda: session.load_restart(session.restart()),
        ):
            with pytest.raises(ValueError, match=r"has a simulation box already.*to_lammps"):
                load()
        np.testing.assert_array_equal(session.packing().position, position)


@pytest.mark.lammps
def test_other_arguments_are_refused():
    with Session() as session:
        with pytest.raises(TypeError, match=r"^packing is 'j\.h5', expected a packing$"):
            session.load("j.h5")
        session.load(start())
        with pytest.raises(TypeError, match=r"^law is 'harmonic', expected Interaction"):
            session.interact("harmonic")
        with pytest.raises(TypeError, match=r"^text is 3, expected text$"):
            session.commands(3)
