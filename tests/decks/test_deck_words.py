"""What the command `jamshape` of a deck does, word for word, with no LAMMPS at the other end."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from jamshape.lammps.deck import folder, restart, settings, whole
from jamshape.lammps.deck.__main__ import WORDS, carry_out, plain
from jamshape.lammps.deck.asking import Deck, Ended, Refused

MAGIC = b"LammpS RestartT\0"
STATE = MAGIC + bytes(100) + MAGIC


class Told(Deck):
    """A deck of this process with these variables, and what it was ordered to do."""

    def __init__(self, atoms=0, step=0, **variables):
        super().__init__(os.getpid(), atoms, step)
        self.variables, self.orders = variables, []

    def ask(self, name):
        return self.variables.get(name)

    def order(self, verb, *texts):
        self.orders.append((verb, *texts))
        if verb == "set":
            self.variables[texts[0]] = texts[1]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


# --- orders ---------------------------------------------------------------------------------------


def test_an_order_is_a_line_of_words_in_hex(capsys):
    name, value = "data", 'é "q"\n$x'
    Deck(1, 2, 3).order("set", name, value)
    words = (f"x{text.encode().hex()}" for text in (name, value))
    assert capsys.readouterr().out == f"@set {' '.join(words)}\n"


@pytest.mark.parametrize(("answer", "value"), [("xc3a9\n", "é"), ("x\n", ""), ("none\n", None)])
def test_an_answer_is_a_value_or_none(answer, value, monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin.readline", lambda: answer, raising=False)
    assert Deck(1, 2, 3).ask("data") == value
    assert capsys.readouterr().out.startswith("@ask x")


def test_files_that_are_read_are_found_and_those_that_are_written_are_not(here):
    with (here / "read").open("w"), (here / "written").open("w"), (here / "read").open():
        found = [path for path in Told().open_files() if path.parent == here]
    assert found == [here / "read"]


def test_only_the_log_of_this_process_is_taken_away(here):
    log = here / "log.lammps"
    log.touch()
    Told().forget_log()
    assert log.exists()
    with log.open("w"):
        Told().forget_log()
    assert not log.exists()


def test_a_sentence_holds_no_sign_that_means_something():
    assert plain('a "b" $c &\né') == "a 'b' ?c ???"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["sing"], "Found 'jamshape sing', expected one of enter, restart, "),
        (["enter", "now"], "Found 'jamshape enter now', expected 'jamshape enter'."),
        (["room"], "Found 'jamshape room', expected 'jamshape room BYTES [halted 0|1 short MB]'."),
        (["room", "5", "halted", "2", "short", "1"], "Found 'jamshape room 5 halted 2 short 1'"),
        (["initial", "alpha"], "Found 'jamshape initial alpha', expected 'jamshape initial --OPT"),
    ],
)
def test_words_that_are_none_are_refused(words, expected):
    with pytest.raises(Ended) as refused:
        carry_out(Told(), words[0], words[1:])
    assert str(refused.value).startswith(expected)


def test_the_page_tells_of_every_word():
    page = (Path(__file__).parents[2] / "docs/how-to/decks.md").read_text(encoding="utf-8")
    assert [word for word in WORDS if f"`jamshape {word}" not in page] == []


# --- settings -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("n", "16", None),
        ("n", "1e3", "n is '1e3', expected a whole number from 1 to 10000000."),
        ("alpha", "0", None),
        ("alpha", "1e-7", "alpha is '1e-7', expected 0 or a number from 1e-06 to 100."),
        ("kappa", "inf", "kappa is 'inf', expected a number from 1e-14 to 0.1."),
        ("sides", "both", "sides is 'both', expected one or two."),
        ("integrator", "rkc2 tolerance 1e-4", None),
        ("integrator", "heun tolerance 1e-4", "integrator is 'heun tolerance 1e-4', expected heun"),
        ("out", " ", "out is ' ', expected a path without control characters"),
        ("data", "a\nb", "data is 'a\\nb', expected a path without control characters"),
    ],
)
def test_values_are_what_they_may_be(name, value, expected):
    found = settings.wrong_value(name, value)
    assert found is None if expected is None else found.startswith(expected)


def test_a_compression_compresses_and_ends():
    run = {"phi_start": "0.4", "phi_end": "0.9", "kappa": "1e-4", "dt": "0.05"}
    assert settings.wrong_run(run) is None
    assert settings.wrong_run({"phi_start": "0.4"}) is None
    assert "expected an end above the start" in settings.wrong_run(run | {"phi_end": "0.4"})
    assert "take more than 1e+12 steps" in settings.wrong_run(run | {"kappa": "1e-13"})


def test_names_of_settings_are_those_of_the_deck():
    text = "variable n index 4\nvariable x equal 2\nvariable d equal is_defined(variable,data)\n"
    text += 'if "$(is_defined(variable,jamshape_plugin))" then "jump SELF loaded"\n'
    assert settings.known_settings(text) == ["n", "data"]


def test_a_name_that_the_open_deck_has_not_is_refused(here, monkeypatch):
    (here / "own.in").write_text("variable out index runs\nvariable kappa index 1e-4\n")
    monkeypatch.setattr(Told, "arguments", lambda _: ["lmp", "-v", "kapa", "1"])
    with (here / "own.in").open(), pytest.raises(Refused, match="no setting kapa, expected kappa"):
        settings.require_settings(Told(out="runs"))


def test_what_the_loader_is_told_is_no_setting(here, monkeypatch):
    (here / "own.in").write_text("variable out index runs\n")
    monkeypatch.setattr(Told, "arguments", lambda _: ["lmp", "-var", "jamshape_python", "yes"])
    with (here / "own.in").open():
        assert settings.require_settings(Told(out="runs")) == {"out": "runs"}


# --- the folder -----------------------------------------------------------------------------------


def test_the_folder_is_made_and_entered_and_paths_become_full(here, monkeypatch):
    monkeypatch.setattr(Told, "arguments", lambda _: [])
    (here / "my start.data").touch()
    (here / "new").mkdir()
    (here / "new" / "final.data.part").touch()
    deck = Told(out="new", data="my start.data")
    folder.enter(deck, [])
    assert deck.orders == [("set", "data", f'"{here}/my start.data"'), ("enter", str(here / "new"))]
    assert Path.cwd() == here / "new"
    assert list(Path.cwd().iterdir()) == []


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("data", "none", "Found no file none, expected the one that -var data names"),
        ("data", ".", "Found no file ., expected"),
        ("restart", "a%b", "expected a path without quotes, [*] and %"),
        ("out", "a%b/c", "Cannot make the folder .*a%b/c .Not a directory., expected one to write"),
    ],
)
def test_paths_that_are_none_are_refused(name, value, expected, here, monkeypatch):
    monkeypatch.setattr(Told, "arguments", lambda _: [])
    (here / "a%b").touch()
    with pytest.raises(Refused, match=expected):
        folder.enter(Told(**{"out": "new", name: value}), [])


def test_a_deck_without_a_folder_is_refused(monkeypatch):
    monkeypatch.setattr(Told, "arguments", lambda _: [])
    with pytest.raises(Refused, match="Found no variable out, expected the folder"):
        folder.enter(Told(), [])


def test_room_is_counted_by_particles(here):
    folder.room(Told(atoms=10), ["500"])
    with pytest.raises(Ended, match=f"{here} has room for .* expected at least 5e[+]15 MB"):
        folder.room(Told(atoms=10**18), ["5000"])
    folder.room(Told(atoms=10), ["500", "halted", "0", "short", "3"])
    with pytest.raises(Ended, match="expected at least 3 MB"):
        folder.room(Told(atoms=10), ["500", "halted", "1", "short", "3"])


DATA = "rods\n\n2 atoms\n2 ellipsoids\n\nAtoms\n\n1\n2\n\nEllipsoids\n\n1 1 1 1\n2 1 1 1\n"


def test_what_is_whole_gets_its_name(here):
    (here / "final.restart.part").write_bytes(STATE)
    (here / "final.data.part").write_text(DATA)
    folder.finish(Told(), [])
    assert {path.name for path in here.iterdir()} == {"final.restart", "final.data"}


@pytest.mark.parametrize("cut", ["state", "data", "dump", "all"])
def test_what_was_cut_short_is_taken_away(cut, here):
    if cut != "all":
        (here / "final.restart.part").write_bytes(STATE[: -1 if cut == "state" else None])
        (here / "final.data.part").write_text(DATA[: -1 if cut == "data" else None])
    (here / "x.dump").write_bytes(dump(0, 10)[: -1 if cut == "dump" else None])
    with pytest.raises(Ended, match="has no room for all that was written, expected a disk that"):
        folder.finish(Told(), ["x.dump", "none.dump"])
    assert [path.name for path in here.iterdir()] == ["x.dump"]
    assert (here / "x.dump").read_bytes() == (dump(0) if cut == "dump" else dump(0, 10))


def test_a_start_that_cannot_be_made_says_why():
    with pytest.raises(Refused, match=r"Found no initial state: .*phi.*\.$"):
        folder.initial(Told(), ["--alpha", "1", "--n", "4", "--phi", "7", "--seed", "1"])


# --- going on -------------------------------------------------------------------------------------


def dump(*steps):
    frame = "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n2\nITEM: ATOMS id x\n1 0.5\n2 0.7\n"
    return "".join(frame.format(step) for step in steps).encode()


def pair(here, *, newest):
    for name in ("restart.a", "restart.b"):
        (here / name).write_bytes(STATE)
        os.utime(here / name, ns=(0, 2 if name == newest else 1))


@pytest.mark.parametrize("newest", ["restart.a", "restart.b"])
def test_the_newest_restart_file_is_read_and_the_other_written_first(newest, here):
    pair(here, newest=newest)
    deck = Told(restart=f'"{here}"')
    restart.restart(deck, [])
    other = "restart.b" if newest == "restart.a" else "restart.a"
    assert deck.orders == [
        ("print", f"Goes on from {newest}, the newest restart file that is whole."),
        ("set", "restart", f'"{here / newest}"'),
        ("set", "restarts", f"{other} {newest}"),
    ]


def test_one_that_was_cut_short_gives_way_to_the_other(here):
    pair(here, newest="restart.a")
    (here / "restart.a").write_bytes(STATE[:-1])
    assert restart.newest_whole(here / "restart.a") == here / "restart.b"
    (here / "restart.b").write_bytes(b"")
    with pytest.raises(Refused, match="is no whole restart file and none lies beside it"):
        restart.restart(Told(restart=str(here)), [])
    assert not whole.is_whole_restart(here / "none")


def test_a_run_that_was_killed_in_its_last_moments_goes_on_from_its_end(here):
    """The deck has removed what it would go on from, and has yet to name the columns of its dump."""
    (here / "final.restart").write_bytes(STATE)
    assert restart.newest_whole(here) == here / "final.restart"
    assert restart.newest_whole(here / "restart.a") == here / "final.restart"
    pair(here, newest="restart.a")
    assert restart.newest_whole(here) == here / "restart.a"


def test_another_file_is_not_replaced_by_one_beside_it(here):
    pair(here, newest="restart.a")
    (here / "final.restart").write_bytes(STATE)
    assert restart.newest_whole(here / "final.restart") == here / "final.restart"
    (here / "final.restart").write_bytes(STATE[:-1])
    assert restart.newest_whole(here / "final.restart") is None


def test_a_new_run_writes_the_first_file_first():
    deck = Told()
    restart.restart(deck, [])
    assert deck.orders == [("set", "restarts", "restart.a restart.b")]


def test_dumps_are_cut_where_the_run_goes_on(here):
    (here / "particles.dump").write_bytes(dump(0, 10, 20) + b"ITEM: TIMES")
    (here / "log.lammps").write_text(
        "Step v_phi v_forces\n0 0.4 5\n10 0.5 25\n20 0.6 60\nLoop time of 1\n"
        "   Step         v_phi        v_forces\n    10   0.5   30\n"
    )
    deck = Told(step=20, restart="restart.a")
    restart.mend(deck, [])
    assert (here / "particles.dump").read_bytes() == dump(0, 10)
    assert deck.orders == [("set", "counted", "60")]
    assert restart.evaluations(here / "log.lammps", 10) == 30
    new = Told(step=0)
    restart.mend(new, [])
    assert new.orders == [("set", "counted", "0")]


@pytest.mark.parametrize("missing", range(1, 60, 7))
def test_a_frame_that_was_cut_short_goes(missing, here):
    (here / "x.dump").write_bytes(dump(0, 10)[:-missing])
    assert whole.cut_dump(here / "x.dump")
    assert (here / "x.dump").read_bytes() == dump(0)
    assert not whole.cut_dump(here / "x.dump")
