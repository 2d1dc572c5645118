"""Features of LAMMPS beside our styles: each a deck, and the number or the sentence that decides whether it works."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import NamedTuple

from lammps_runs import QUIET, load_plugin, start_lmp

LOAD = load_plugin()

HEAD = "dimension 2\natom_style ellipsoid\natom_modify map array"

# Two rods of length 5 and width 1 that overlap, in a box of edge 20.
BOX = f"""{LOAD}
region box block 0 20 0 20 -0.5 0.5
create_box 2 box"""
RODS = """create_atoms 1 single 10 10 0
create_atoms 2 single 11.5 10.8 0
set group all shape 5 1 1
set group all density 1"""
LAW = """pair_style spherocylinder/harmonic sides two
pair_coeff * * 1.0
thermo_modify norm no"""
# What may be asked for after a run: a sum that sees every position and direction among it.
OUTPUT = """compute quaternions all property/atom quatw quatk
variable pose atom id*(x+2*y+c_quaternions[1]+2*c_quaternions[2])
compute poses all reduce sum v_pose
compute turned all reduce max c_quaternions[2]
thermo_style custom step lx pe press c_poses c_turned
thermo_modify norm no"""
TWO_RODS = f"{HEAD}\n{BOX}\n{RODS}\n{LAW}\n{OUTPUT}"

# A disc of diameter 1 alone, off the centre of that box.
DISC = f"""{HEAD}
{BOX}
create_atoms 1 single 5 10 0
set group all shape 1 1 1
set group all density 1
{LAW}
{OUTPUT}"""

# 64 short rods that all touch neighbours and cannot cross.
CROWD = f"""{HEAD}
{LOAD}
lattice sq 1.0
region box block 0 8 0 8 -0.5 0.5
create_box 2 box
create_atoms 1 box
set group all type/fraction 2 0.5 7
set group all shape 1.4 0.8 0.8
set group all density 1
set group all quat/random 11
displace_atoms all random 0.1 0.1 0 13
{LAW}
{OUTPUT}"""


class Feature(NamedTuple):
    """A deck with a feature, and what must come of it: a number, or one sentence.

    Attributes
    ----------
    name : str
        First column of the table; unique.
    commands : str
        Deck after `scene`.
    measure : str
        LAMMPS's formula of the number that decides, such as ``lx``, evaluated after the deck.
    right : float or str
        The right number; or, as text, the commands of a deck without the feature that gives it.
    within : float
        Largest relative error.
    refused : str
        Regular expression of the whole sentence with which LAMMPS must end.
    warned : str
        Regular expression of a warning that must be in the log.
    scene : str
        Deck that comes before, `TWO_RODS`, `DISC`, `CROWD` or another.
    ranks : int
        How many, each a partition of its own if more than one.
    """

    name: str
    commands: str
    measure: str = ""
    right: float | str = 0.0
    within: float = 1e-12
    refused: str = ""
    warned: str = ""
    scene: str = TWO_RODS
    ranks: int = 1


class Outcome(NamedTuple):
    works: bool
    found: str
    """The number and the right one, or LAMMPS's sentence."""
    holds: bool


def run_deck(text, folder, ranks=1):
    """Exit code and output of `lmp` on a deck, in processes of its own."""
    (folder / "deck.in").write_text(text + "\n")
    partitions = ["-partition", f"{ranks}x1"] if ranks > 1 else []
    done = start_lmp(*QUIET, "-in", "deck.in", *partitions, cwd=folder, ranks=ranks)
    of_partitions = [path.read_text() for path in sorted(folder.glob("screen.*"))]
    return done.returncode, "".join([done.stdout, *of_partitions])


def sentence_of(output):
    """Return the sentence with which LAMMPS ended, or what else is known of its end."""
    found = re.findall(
        r"^(?:.*\bERROR|ERROR on proc \d+): (.*?)(?: \(\S+:\d+\))?$", output, re.MULTILINE
    )
    if found:
        return str(found[0])
    lines = output.strip().splitlines()
    return f"no sentence, but: {lines[-1] if lines else ''}"


def _measured(deck, feature):
    """Return the number that a deck gives (None where LAMMPS ended), and all that it printed."""
    with tempfile.TemporaryDirectory() as folder:
        asked = f'{feature.scene}\n{deck}\nprint "measured $({feature.measure or "step"}:%.17g)"'
        code, output = run_deck(asked, Path(folder), feature.ranks)
    numbers = re.findall(r"^measured (\S+)$", output, re.MULTILINE)
    return (float(numbers[-1]) if code == 0 and numbers else None), output


def judge(feature):
    """Run a feature's deck and compare with what must come of it."""
    number, output = _measured(feature.commands, feature)
    if number is None:
        sentence = sentence_of(output)
        holds = bool(feature.refused) and re.fullmatch(feature.refused, sentence) is not None
        return Outcome(False, sentence, holds)
    if feature.refused:
        return Outcome(True, f"{number:.12g}, expected a refusal", False)
    right = feature.right
    if isinstance(right, str):
        right_number, said = _measured(right, feature)
        assert right_number is not None, said[-2000:]
        right = right_number
    holds = abs(number - right) <= feature.within * abs(right)
    warning = re.search(f"^WARNING: {feature.warned}", output, re.MULTILINE)
    found = f"{feature.measure} = {number:.12g}, right {right:.12g}"
    return Outcome(True, found, holds and (not feature.warned or warning is not None))
