"""Programs that host LAMMPS: an error is an exception there, whatever the folder of temporary files and the locale."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

import jamshape as js
from jamshape.lammps.module import load_errors
from jamshape.lammps.plugin import errors_path
from jamshape.lammps.session import Session

pytestmark = pytest.mark.lammps

TOO_LONG_STEP = """
import jamshape as js
discs = js.Spherocylinders(alpha=0)
try:
    js.compress(discs, n=16, phi=(0.4, 0.9), kappa=1e-3, dt=2.0, rows=20, frames=4, progress=False)
except Exception as error:
    print("caught", type(error).__name__, error)
print("still alive")
"""
SENTENCE = "caught LammpsError fix overdamped/affine found timestep 2 above the stability limit"
COMPRESSED = """
import os, jamshape as js
run = js.compress(js.Spherocylinders(alpha=1), n=8, phi=(0.3, 0.4), kappa=1e-2, rows=2, frames=2, {file}progress=False)
again = js.slow_compress(start=run.file, phi=(0.4, 0.401), kappa=1e-2, progress=False)
print(ascii((round(float(run.phi[-1]), 3), again.about["start"])))
"""


def host(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code], env=os.environ | environment, capture_output=True, text=True,
        timeout=120, check=False,
    )  # fmt: skip


def test_an_error_of_lammps_ends_no_program():
    done = host(TOO_LONG_STEP)
    assert done.returncode == 0
    assert done.stdout.startswith(SENTENCE)
    assert done.stdout.endswith("still alive\n")
    assert "ERROR" not in done.stderr


def test_nor_a_kernel_of_a_notebook():
    """An asyncio loop is running."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    cells = [nbformat.v4.new_code_cell(code) for code in (TOO_LONG_STEP, "print(js.__name__)")]
    ran = nbclient.NotebookClient(nbformat.v4.new_notebook(cells=cells), timeout=120).execute()
    first, second = ("".join(o.get("text", "") for o in cell.outputs) for cell in ran.cells)
    assert SENTENCE in first
    assert "still alive" in first
    assert second == "jamshape\n"


@pytest.mark.skipif(errors_path() is None, reason="this LAMMPS raises by itself")
def test_a_lammps_that_was_there_before_is_told_of():
    done = host(
        "from lammps import lammps\n"
        "lammps(cmdargs=['-screen', 'none', '-log', 'none']).close()\n"
        "from jamshape.lammps.session import Session\nSession().close()"
    )
    assert done.returncode == 0, done.stderr
    assert "LAMMPS was loaded in this process before jamshape" in done.stderr


@pytest.mark.skipif(errors_path() is None, reason="this LAMMPS raises by itself")
def test_other_users_of_lammps_meet_its_own_errors():
    """Only within a command of ours does an error throw: nobody else would catch it."""
    done = host(
        "from jamshape.lammps.session import Session\nsession = Session()\n"
        "session.lmp.command('joke')\nprint('alive')"
    )
    assert done.returncode == 1
    assert "alive" not in done.stdout
    assert load_errors().jamshape_is_asked()


@pytest.mark.parametrize("name", ['a*b"c d$e%', "Gr\xf6\xdfe"])
def test_folders_and_files_of_any_name_are_taken(tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    path = f"os.path.join(os.environ['TMPDIR'], os.fsdecode({os.fsencode(name)!r}) + '.h5')"
    done = host(
        COMPRESSED.format(file=f"file={path}, "), TMPDIR=str(folder), LC_ALL="C", PYTHONUTF8="0",
        PYTHONCOERCECLOCALE="0",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == ascii((0.4, str(folder / f"{name}.h5")))


def test_one_of_several_ranks_runs_nothing(monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    sentence = "^found 2 MPI ranks .*, expected one process, since they would share each run"
    with pytest.raises(RuntimeError, match=sentence):
        Session()
    with pytest.raises(RuntimeError, match=sentence):
        js.compress(js.Spherocylinders(alpha=1), n=8, progress=False)


def test_a_log_that_cannot_be_written_ends_no_program(tmp_path):
    with pytest.raises(FileNotFoundError, match="no/such"):
        Session(log=tmp_path / "no" / "such.log")
    with Session(log=tmp_path / "a.log") as session:
        session.commands("units lj")
    assert "units lj" in (tmp_path / "a.log").read_text()
