"""Run pyscripts/sweep.smk on Slurm, kill a job and a node, and see that nothing is lost and nothing made twice.

    .venv/bin/python tests/cluster/slurm_on_one_node.py

As root on Debian 12, where jamshape is set up (`./run setup`); six minutes. Slurm comes from Debian's packages, which
stay installed; Snakemake and its executor for Slurm come from PyPI into a virtual environment. That, the configuration,
all files and sockets lie in a temporary folder, which is removed unless something fails, and the daemons listen on
127.0.0.1 only. `--snakemake PROGRAM` takes a Snakemake that is there and sees jamshape; `--keep` leaves the folder.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import signal
import site
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path

import h5py

import jamshape as js

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "tests" / "kills"))
sys.path.append(str(ROOT / "tests" / "styles"))
from killing import differences, require_whole

PACKAGES = ("slurmctld", "slurmd", "slurm-client", "openmpi-bin")
PYTHON_PACKAGES = ("snakemake>=9", "snakemake-executor-plugin-slurm>=2")
NODE = os.uname().nodename

# Without systemd, control groups, an accounting database and MUNGE; a node that is silent for 10 s is down.
SLURM_CONF = """
ClusterName=one
SlurmctldHost={node}(127.0.0.1)
SlurmctldPort={port}
SlurmdPort={node_port}
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
AuthType=auth/none
CredType=cred/none
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
SlurmdTimeout=10
KillWait=5
MinJobAge=900
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/ended.txt
NodeName={node} NodeAddr=127.0.0.1 CPUs=2 RealMemory=1500
PartitionName=short Nodes={node} Default=YES MaxTime=60 State=UP
"""

# A packing takes seconds, long enough to be cut off on its way, which LAMMPS goes in steps of srun.
PACKING = "--n 32 --way dynamics --kappa 1e-6"
SAMPLES, CHUNK = 8, 2
SWEEP = {"out": "sweep", "sweep": f"--alpha 4 --samples {SAMPLES} {PACKING}", "chunk": str(CHUNK)}
JOBS = SAMPLES // CHUNK
DECK = ("-var", "out", "deck", "-var", "n", "24", "-var", "kappa", "2e-4", "-var", "phi_end", "0.7")


class UnexpectedError(Exception):
    """Unexpected result: found and expected value."""


def say(text):
    print(f"{time.monotonic() - BEGAN:4.0f} s  {text}", flush=True)


BEGAN = time.monotonic()


def require(condition, sentence):
    if not condition:
        raise UnexpectedError(sentence)


def wait_until(condition, seconds, what):
    """Wait until a condition holds and return what it gives, or fail after some seconds."""
    until = time.monotonic() + seconds
    while not (found := condition()):
        require(time.monotonic() < until, f"{what} did not happen in {seconds} s, expected it to")
        time.sleep(0.2)
    return found


def run(*words, seconds=60, check=True, **more):
    """Run a program to its end and return what it printed, both streams in one."""
    done = subprocess.run(
        [str(word) for word in words],
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=seconds,
        **more,
    )
    require(
        done.returncode == 0 or not check,
        f"{' '.join(map(str, words))} ended with {done.returncode}, expected 0: {done.stdout[-800:]}",
    )
    return done.stdout


# --- what has to be there -------------------------------------------------------------------------


def install_debian_packages():
    require(shutil.which("dpkg-query"), "found no dpkg-query, expected Debian 12; run it there")
    require(
        os.geteuid() == 0, "found no root, expected it, to install and to start Slurm; use sudo"
    )
    status = ("dpkg-query", "-W", "-f=${Status}\n")
    missing = [p for p in PACKAGES if "ok installed" not in run(*status, p, check=False)]
    if missing:
        say(f"Installing the Debian packages {', '.join(missing)}.")
        run("apt-get", "update", "-q", seconds=300)
        install = ("apt-get", "install", "-qy", "--no-install-recommends", *missing)
        quiet = {"DEBIAN_FRONTEND": "noninteractive"}
        run(*install, seconds=600, env=os.environ | quiet, stdin=subprocess.DEVNULL)


def install_snakemake(folder):
    """Make an environment with Snakemake that sees what this Python sees, jamshape too."""
    say("Installing Snakemake and its executor for Slurm into an environment of their own.")
    run(sys.executable, "-m", "venv", folder, seconds=120)
    run(folder / "bin" / "pip", "install", "-q", *PYTHON_PACKAGES, seconds=600)
    [packages] = folder.glob("lib/python3*/site-packages")
    seen = [*site.getsitepackages(), *(p for p in sys.path if p.endswith("-packages"))]
    lines = [f"import site; site.addsitedir({place!r})" for place in dict.fromkeys(seen)]
    lines.append(str(Path(js.__file__).parents[1]))
    (packages / "of_jamshape.pth").write_text("\n".join(lines) + "\n")
    return folder / "bin" / "snakemake"


# --- Slurm ----------------------------------------------------------------------------------------


class Slurm:
    """A controller and one node, as processes of this one; a context manager."""

    def __init__(self, folder):
        self.folder = folder
        for name in ("state", "spool", "bin"):
            (folder / name).mkdir()
        port = 20000 + 2 * secrets.randbelow(5000)
        told = {"node": NODE, "folder": folder, "port": port, "node_port": port + 1}
        self.conf = folder / "slurm.conf"
        self.conf.write_text(SLURM_CONF.format(**told))
        # Snakemake's job forgets SLURM_CONF before it calls srun, which then looks in /etc.
        srun = folder / "bin" / "srun"
        srun.write_text(f'#!/bin/sh\nSLURM_CONF={self.conf} exec {shutil.which("srun")} "$@"\n')
        srun.chmod(0o755)
        self.environment = os.environ | {
            "SLURM_CONF": str(self.conf),
            # The decks take the first python3 that they find.
            "PATH": os.pathsep.join(
                [str(srun.parent), str(Path(sys.executable).parent), os.environ["PATH"]]
            ),
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        self.daemons = {}

    def __enter__(self):
        try:
            for name in ("slurmctld", "slurmd"):
                self.start(name)
            wait_until(lambda: self.state() == "idle", 30, "the node's being idle")
        except BaseException:
            self.__exit__()
            raise
        return self

    def start(self, name):
        with (self.folder / f"{name}.log").open("a") as log:
            self.daemons[name] = subprocess.Popen(
                [f"/usr/sbin/{name}", "-D"],
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
                cwd=self.folder,
                env=self.environment,
                start_new_session=True,
            )

    def fallen(self):
        """Find daemons that have ended."""
        return [name for name, daemon in self.daemons.items() if daemon.poll() is not None]

    def run(self, *words, **more):
        return run(*words, env=self.environment, **more)

    def state(self):
        return self.run("sinfo", "-h", "-o", "%T", check=False).strip()

    def jobs(self, state="R"):
        """Find jobs in a state: numbers by what they make, which Snakemake tells in a comment."""
        found = self.run("squeue", "-h", "-t", state, "-o", "%i|%k").splitlines()
        both = [line.split("|") for line in found]
        return {comment.rpartition("name_")[2]: job for job, comment in both}

    def processes(self, job=None):
        """Find the processes of a job, or of all, but not those of Slurm that watch them."""
        rows = self.run("scontrol", "listpids", *([job] if job else []), check=False).splitlines()
        return [int(row.split()[0]) for row in rows if row.split()[0].isdecimal()]

    def watchers(self):
        """Find the processes of Slurm that watch jobs, by the folder that they have open."""
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                is_one = (process / "comm").read_text().strip() == "slurmstepd"
                environment = (process / "environ").read_bytes() if is_one else b""
                if str(self.conf).encode() in environment:
                    found.append(int(process.name))
        return found

    def ended(self):
        """Count the jobs that have ended, by how."""
        path = self.folder / "ended.txt"
        return Counter(re.findall(r"JobState=(\w+)", path.read_text() if path.exists() else ""))

    def __exit__(self, *_):
        with suppress(subprocess.TimeoutExpired, OSError):
            self.run("scancel", "--user", "root", check=False, seconds=10)
            until = time.monotonic() + 10
            while self.watchers() and time.monotonic() < until:
                time.sleep(0.2)
        kill([*self.watchers(), *(d.pid for d in self.daemons.values() if d.poll() is None)])
        for daemon in self.daemons.values():
            daemon.wait(10)


def kill(processes):
    for process in processes:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


# --- the sweep ------------------------------------------------------------------------------------


class Sweep:
    """The sweep in a folder, started by the same command again and again."""

    def __init__(self, slurm, snakemake):
        self.slurm, self.snakemake = slurm, snakemake
        self.folder = slurm.folder / SWEEP["out"]
        self.calls = 0

    def start(self):
        self.calls += 1
        self.log = self.slurm.folder / f"snakemake_{self.calls}.log"
        config = [f"{name}={value}" for name, value in SWEEP.items()]
        words = [self.snakemake, "-s", ROOT / "pyscripts" / "sweep.smk"]
        words += ["--config", *config, "mem_mb=500", "minutes=10"]
        words += ["--executor", "slurm", "--jobs", "10", "--keep-going", "--rerun-incomplete"]
        words += ["--default-resources", "slurm_partition=short", "--slurm-no-account"]
        # There is no accounting here; usual clusters have it.
        words += ["--slurm-status-command", "squeue"]
        words += ["--slurm-init-seconds-before-status-checks", "3"]
        with self.log.open("w") as log:
            return subprocess.Popen(
                [str(word) for word in words],
                cwd=self.slurm.folder,
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
                env=self.slurm.environment,
            )

    def ended(self, process, code):
        """Wait for the end of Snakemake, with an exit code."""
        try:
            wait_until(
                lambda: process.poll() is not None or self.slurm.fallen(), 300, "Snakemake's end"
            )
            require(
                not self.slurm.fallen(),
                f"{self.slurm.fallen()} ended by itself, expected it to stay",
            )
        finally:
            process.kill()
            process.wait(10)
        said = self.log.read_text()
        require(
            process.returncode == code,
            f"Snakemake ended with {process.returncode}, expected {code}: {said[-1500:]}",
        )
        return said

    def finished(self):
        """Find finished packings, with all that would change if they were made again."""
        paths = self.folder.glob("*_seed?.h5")
        return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in paths}

    def job_under_way(self):
        """Find a running job that has made its first packing and is in the middle of its second."""
        for name, job in self.slurm.jobs().items():
            first, last = map(int, re.findall(r"\d+", name)[-2:])
            begun = self.folder / f"alpha4_seed{last}.h5.run.h5"
            there = self.finished()
            is_done = [f"alpha4_seed{seed}.h5" in there for seed in (first, last)]
            if is_done == [True, False] and begun.exists():
                return name, job, last
        return None


def kill_a_job(slurm, sweep):
    """Kill the processes of a job in the middle of a packing; all others are made."""
    process = sweep.start()
    name, job, seed = wait_until(sweep.job_under_way, 120, "a job in the middle of a packing")
    kill(slurm.processes(job))
    before = sweep.finished()
    say(
        f"Killed job {job} ({name}) in the middle of seed {seed}; {len(before)} packings were finished."
    )
    said = sweep.ended(process, 1)
    require(f"SLURM-job '{job}' failed" in said, f"job {job} is not told as failed in {sweep.log}")
    require_unchanged(before, sweep)
    lost = {f"alpha4_seed{s}.h5" for s in range(1, SAMPLES + 1)} - set(sweep.finished())
    require(lost == {f"alpha4_seed{seed}.h5"}, f"{lost} are not made, expected seed {seed} alone")
    require(slurm.ended() == {"FAILED": 1, "COMPLETED": JOBS - 1}, f"jobs ended: {slurm.ended()}")
    require(
        (sweep.folder / f"alpha4_seed{seed}.h5.run.h5").exists(),
        f"what seed {seed} had got to is gone, expected it to stay",
    )
    say(
        f"The other {JOBS - 1} jobs made their packings, {SAMPLES - 1} are there; the half-made one is kept."
    )
    return seed


def kill_the_node(slurm, sweep, seed):
    """Start again, and kill the daemon of the node and all that runs on it; Slurm begins the job again."""
    before, began = sweep.finished(), time.time()
    process = sweep.start()
    job = wait_until(lambda: [*slurm.jobs().values()], 60, "the start of the job that failed")[0]
    require(
        len(slurm.jobs("R,PD")) == 1, "more than one job was submitted, expected the failed one"
    )
    wait_until(lambda: is_going_on(sweep, seed, began), 30, "going on with the packing")
    kill([slurm.daemons["slurmd"].pid, *slurm.watchers(), *slurm.processes(job)])
    slurm.daemons["slurmd"].wait(10)
    say(
        f"Started the same command again: one job, {job}. Killed slurmd and all that ran on the node."
    )
    wait_until(lambda: slurm.state().startswith("down"), 90, "the node's being down")
    slurm.start("slurmd")
    wait_until(lambda: slurm.state() == "idle", 60, "the node's coming back")
    wait_until(lambda: slurm.jobs("PD"), 60, "the job's being queued again by Slurm")
    say(
        "Slurm saw the node down, queued the job again, to begin in two minutes as is its way, and has the"
    )
    say("node back: slurmd was started anew.")
    sweep.ended(process, 0)
    require_unchanged(before, sweep)
    say("Snakemake waited for it and ended well.")


def is_going_on(sweep, seed, since):
    """Whether something was written beside an unfinished packing since a time."""
    there = sweep.folder.glob(f"alpha4_seed{seed}.h5.*")
    times = []
    for path in there:
        with suppress(OSError):  # removed by who writes the next
            times.append(path.stat().st_mtime)
    return max(times, default=0.0) > since


def require_unchanged(before, sweep):
    after = sweep.finished()
    again = [name for name, stamp in before.items() if after.get(name) != stamp]
    require(not again, f"{again} were finished and were made again, expected them to stay")


def start_once_more(slurm, sweep):
    """The same command has nothing to do."""
    before, jobs = sweep.finished(), slurm.ended()
    said = sweep.ended(sweep.start(), 0)
    require("Nothing to be done" in said, f"Snakemake found something to do: {said[-800:]}")
    require(sweep.finished() == before, "packings were made again, expected none")
    require(slurm.ended() == jobs, f"jobs ended: {slurm.ended()}, expected no more than {jobs}")
    say("Once more the same command: nothing to be done, no job submitted.")


def require_all(slurm, sweep, killed):
    """All that was asked for is there, whole, and as if nothing had been killed; nothing else is there."""
    expected = {"reports"}
    for seed in range(1, SAMPLES + 1):
        name = f"alpha4_seed{seed}"
        expected |= {f"{name}.h5", f"{name}.h5.run.h5", f"{name}.log"}
        packing = js.load(sweep.folder / f"{name}.h5")
        outcome = packing.results["outcome"]
        require(outcome in {"converged", "sliding"}, f"{name} is {outcome}, expected a minimum")
    found = {path.name for path in sweep.folder.iterdir()}
    require(found == expected, f"{found ^ expected} are too many or too few in {sweep.folder}")
    require_whole(sweep.folder)
    reports = [json.loads(path.read_text()) for path in (sweep.folder / "reports").iterdir()]
    made = sum(report["made"] for report in reports)
    require((len(reports), made) == (JOBS, SAMPLES), f"{len(reports)} reports tell {made} packings")
    # A job that Slurm queues again is written once when its node is lost, and once when it ends.
    ends = slurm.ended()
    expected_ends = {"FAILED": 1, "NODE_FAIL": 1, "COMPLETED": JOBS}
    require(ends == expected_ends, f"jobs ended: {dict(ends)}, expected {expected_ends}")
    undisturbed = slurm.folder / "undisturbed"
    words = ("--alpha", "4", *PACKING.split(), "--first-seed", killed, "--samples", "1")
    run(sys.executable, "-m", "jamshape", "sweep", *words, "--out", undisturbed, seconds=120)
    name = f"alpha4_seed{killed}.h5"
    differing = differences(undisturbed / name, sweep.folder / name)
    require(not differing, f"{name} differs from one that was never killed in {differing}")
    say(
        f"All {SAMPLES} packings are there and whole, no other file is; those that were finished kept"
    )
    say(
        f"their files. {ends.total()} ends of jobs: {JOBS} completed, one killed, one lost with its node and queued again."
    )
    say(
        f"The packing that was killed twice is to the bit the one of a sweep that nobody killed (seed {killed})."
    )


def run_ranks(slurm):
    """In a job of two tasks a deck runs on both by mpirun, and a command of jamshape refuses to run twice."""
    deck = ROOT / "inputs" / "compress_spherocylinder.in"
    pack = f"{sys.executable} -m jamshape pack --alpha 1 --n 16 --out ranks.h5"
    script = slurm.folder / "ranks.sh"
    lines = ["#!/bin/bash", f"mpirun -np 2 lmp -in '{deck}' {' '.join(DECK)} || exit 3"]
    lines += [f"srun -n 2 {pack} && exit 4", f"mpirun -np 2 {pack} && exit 5"]
    lines += ["test -e ranks.h5 && exit 6", f"{pack} || exit 7", "exit 0"]
    script.write_text("\n".join(lines) + "\n")
    batch = ("sbatch", "--wait", "-n", "2", "-o", "ranks.log", script.name)
    slurm.run(*batch, cwd=slurm.folder, seconds=120, check=False)
    said = (slurm.folder / "ranks.log").read_text()
    require(
        (slurm.folder / "ranks.h5").exists(), f"the job of two tasks ended early: {said[-1500:]}"
    )
    require("2 by 1 by 1 MPI processor grid" in said or "1 by 2 by 1 MPI processor grid" in said,
            f"the deck did not run on two ranks: {said[-1500:]}")  # fmt: skip
    for name in ("SLURM_STEP_NUM_TASKS", "OMPI_COMM_WORLD_SIZE"):
        require(
            f"found 2 MPI ranks ({name}), expected one process" in said, f"no refusal by {name}"
        )
    with h5py.File(slurm.folder / "ranks.h5") as file:
        require("outcome" in file["parameters"].attrs, "ranks.h5 holds no finished packing")
    say(
        "In a job of two tasks a deck ran on two ranks by mpirun; `jamshape pack` refused to run twice,"
    )
    say("by srun and by mpirun, and made its packing when it was started by itself.")


def main():
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--snakemake", type=Path, help="one that is there (a new one)")
    parser.add_argument("--keep", action="store_true", help="leave the folder")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("slurm_on_one_node.py: ended by a signal."))
    folder = Path(tempfile.mkdtemp(prefix="slurm_"))
    try:
        install_debian_packages()
        snakemake = options.snakemake or install_snakemake(folder / "snakemake")
        with ExitStack() as stack:
            slurm = stack.enter_context(Slurm(folder))
            say(f"Slurm of one node with two cores runs in {folder}.")
            sweep = Sweep(slurm, snakemake)
            killed = kill_a_job(slurm, sweep)
            kill_the_node(slurm, sweep, killed)
            start_once_more(slurm, sweep)
            require_all(slurm, sweep, killed)
            run_ranks(slurm)
    except (UnexpectedError, subprocess.TimeoutExpired) as error:
        sys.exit(f"slurm_on_one_node.py: {error}; see the logs in {folder}.")
    if not options.keep:
        shutil.rmtree(folder)
    say("Nothing was lost and nothing made twice; all daemons have ended.")


if __name__ == "__main__":
    main()
