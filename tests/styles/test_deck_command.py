"""The command `jamshape` in stock LAMMPS: it carries out on all ranks what a Python beside it orders."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from lammps_scenes import command_line, complaints_of, environment, load_plugin

pytestmark = pytest.mark.lammps

STRANGE = "a  \"b\" 'c' $x ${y} $(z) é # & *%"


def orders(*lines, code=0):
    """A Python that orders this, whatever it is asked."""
    texts = "\n".join(f"print({line!r}, flush=True)" for line in lines)
    return f"#!{sys.executable}\nimport sys\n{texts}\nsys.exit({code})\n"


def in_hex(text):
    return f"x{os.fsencode(text).hex()}"


def run(folder, deck, *, ranks=1, python=None):
    """`lmp` with this deck, and a program in the place of Python."""
    (folder / "own.in").write_text(deck)
    more = {}
    if python is not None:
        more["JAMSHAPE_PYTHON"] = str(folder / "python")
        (folder / "python").write_text(python)
        (folder / "python").chmod(0o755)
    return subprocess.run(
        command_line("-in", "own.in", ranks=ranks), cwd=folder, env=environment() | more, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60, check=False,
    )  # fmt: skip


def sentence_of(done):
    assert done.returncode == 1, done.stdout
    [sentence] = complaints_of(done)
    return sentence


@pytest.mark.parametrize("ranks", [1, 2])
def test_orders_are_carried_out_by_all_ranks(ranks, tmp_path):
    (tmp_path / STRANGE).mkdir()
    told = orders(
        f"@set {in_hex('told')} {in_hex(STRANGE)}", f"@enter {in_hex(STRANGE)}",
        f"@print {in_hex(STRANGE)}", "a warning of Python", f"@ask {in_hex('told')}",
    )  # fmt: skip
    told = told.replace(
        "sys.exit", "print('@print', sys.stdin.readline(), flush=True)\nprint('@done')\nsys.exit"
    )
    done = run(tmp_path, f"{load_plugin()}\njamshape it\nlog here\n", ranks=ranks, python=told)
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[-3:-1] == [STRANGE, STRANGE]
    assert "a warning" not in done.stdout
    assert [path.name for path in (tmp_path / STRANGE).iterdir()] == ["here"]


ASKS = """import sys
for name in sys.argv[8:]:
    print(f"@ask x{name.encode().hex()}", flush=True)
    answer = sys.stdin.readline().strip()
    print(f"@print x{answer.encode().hex()}", flush=True)
print("@print", "x" + " ".join(sys.argv[2:8]).encode().hex(), flush=True)
print("@done", flush=True)
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_variables_are_answered_formulas_among_them(ranks, tmp_path):
    deck = f"""{load_plugin()}
region box block 0 4 0 4 0 4
create_box 1 box
create_atoms 1 single 1 1 1
mass 1 1
variable text index "a b"
variable held equal count(all)
jamshape it text held none
"""
    done = run(tmp_path, deck, ranks=ranks, python=f"#!{sys.executable}\n{ASKS}")
    assert done.returncode == 0, done.stdout
    answers = done.stdout.splitlines()
    assert answers[-5:-2] == [in_hex("a b"), in_hex("1"), "none"]
    assert re.fullmatch(r"-m jamshape.lammps.deck \d+ 1 0 it", answers[-2])


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("program", "said"),
    [
        (orders("nothing to say", code=3), "nothing to say"),
        (orders(f"@print {in_hex('hello')}", code=3), ""),
        ("#!/bin/sh\nkill -9 $$\n", ""),
        ("no program\n", "Exec format error|not found"),
    ],
)
def test_a_python_that_does_not_answer_is_one_sentence(program, said, ranks, tmp_path):
    done = run(tmp_path, f"{load_plugin()}\njamshape enter\n", ranks=ranks, python=program)
    assert re.fullmatch(
        rf"ERROR: Found no answer of {tmp_path}/python to 'jamshape enter' \(.*({said}).*\), expected a Python in which "
        "jamshape is installed: set JAMSHAPE_PYTHON to its path.",
        sentence_of(done),
    )


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_folder_that_is_not_there_is_one_sentence(ranks, tmp_path):
    done = run(tmp_path, f"{load_plugin()}\njamshape it\n", ranks=ranks,
               python=orders(f"@enter {in_hex('none')}", "@done"))  # fmt: skip
    assert sentence_of(done) == (
        "ERROR: Cannot enter the folder none (No such file or directory), expected one that all ranks reach: "
        "name another with -var out."
    )


def test_words_that_are_none_are_one_sentence(tmp_path):
    said = sentence_of(run(tmp_path, f"{load_plugin()}\njamshape sing loud\n"))
    assert said.startswith("ERROR: Found 'jamshape sing loud', expected one of enter, ")
    said = sentence_of(run(tmp_path, f"{load_plugin()}\njamshape\n"))
    assert said.startswith("ERROR: jamshape found no word, expected one such as enter")


def test_the_styles_are_loaded_once_and_again_after_clear(tmp_path):
    deck = f"{load_plugin()}\n{load_plugin()}\nclear\n{load_plugin()}\npair_style spherocylinder/harmonic sides one\n"
    done = run(tmp_path, deck + 'print "<${jamshape_plugin}>"\n')
    assert done.returncode == 0, done.stdout
    assert f"<{environment()['JAMSHAPE_PLUGIN']}>" in done.stdout.splitlines()
