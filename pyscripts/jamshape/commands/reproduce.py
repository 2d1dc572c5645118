"""Reproduce a paper: make all its data and figures, and compare its numbers with ours.

    jamshape reproduce marschall-2018
    jamshape reproduce yuan-2019 --scale small --jobs 2 --out runs/yuan
    jamshape reproduce yuan-2019 --scale full --samples 2 --figures fig03 fig05
    jamshape reproduce vanderwerf-2018 --scale small
    jamshape reproduce zhang-2021
    jamshape reproduce marschall-shear
    jamshape reproduce brito-2018
    jamshape reproduce rocks-hoy-2023
    jamshape reproduce heussinger-2020

The scale `demo` takes minutes on two cores, `small` an hour, and `full`, with the papers' sizes, several hours.
The last output is agreement.md, a page with every number beside the paper's, the figures, and a list of runs.
Needs Snakemake and a clone of the repository, whose folder analysis/ has the workflows. The same command resumes
after a kill, and with --seconds it stops in time. The last line of standard output is one JSON object; the exit code
is 0 only if every figure exists.
"""

from __future__ import annotations

import csv
import fcntl
import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

from jamshape.checks import RANGES, TimeLimitError, require_in
from jamshape.command import parser_of, report
from jamshape.front.progress import follow
from jamshape.recording.driver import Told
from jamshape.recording.workers import cores, python_path

PAPERS = (
    "marschall-2018", "yuan-2019", "vanderwerf-2018", "zhang-2021", "marschall-shear", "brito-2018",
    "rocks-hoy-2023", "heussinger-2020",
)  # fmt: skip
SCALES = ("demo", "small", "full")

GO_ON = "the same command makes what is missing"

_PAGE, _TABLE = "agreement.md", "agreement.csv"
_DONE = re.compile(r"^(\d+) of (\d+) steps")
_OUTPUT = re.compile(r"^\s+output: (?:reports|figures)/([^/,]+)\.json")
_PATIENCE = 60  # seconds, for jobs to end after Ctrl-C


class Step(NamedTuple):
    """Progress of Snakemake."""

    done: int = 0
    of: int = 0
    failed: str = ""
    """A failed job, and its last line."""


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    parser.add_argument("paper", choices=PAPERS)
    parser.add_argument(
        "--scale", choices=SCALES, default="demo", help="size of the study (%(default)s)"
    )
    more = "largest number of packings or runs of each kind; can be raised later"
    parser.add_argument("--samples", type=int, metavar="N", help=f"{more} (those of the scale)")
    chosen = "only these figures, with their data (all)"
    parser.add_argument("--figures", nargs="+", default=[], metavar="NAME", help=chosen)
    parser.add_argument("--jobs", type=int, default=cores(), help="processes (all cores)")
    parser.add_argument("--out", type=Path, help="folder (runs/PAPER_SCALE)")
    late = "stop after this time [s], with exit code 75; the same command resumes"
    parser.add_argument("--seconds", type=float, help=late)
    parser.add_argument("--dry-run", action="store_true", help="list the jobs without running them")
    return parser


def workflow_of(paper: str) -> Path:
    """Find the workflow of a paper: beside this package in a clone, or in the clone around the working folder.

    Raises
    ------
    ValueError
        If there is neither.
    """
    name = Path("analysis") / paper.replace("-", "_") / "reproduce.smk"
    roots = (Path(__file__).parents[3], Path.cwd())
    for root in roots:
        if (root / name).is_file():
            return root / name
    msg = (
        f"found no {name} in {' nor in '.join(map(str, dict.fromkeys(roots)))}, expected a clone of the"
        " repository, since an installed package has no workflows; run it in the clone"
    )
    raise ValueError(msg)


def with_samples(settings: Mapping[str, Any], samples: int | None) -> dict[str, Any]:
    """Limit the number of samples of each kind in the settings of a scale; None keeps them.

    Examples
    --------
    >>> with_samples({"n": 1024, "samples": 6, "order_samples": 1}, 2)
    {'n': 1024, 'samples': 2, 'order_samples': 1}
    """
    counts = [name for name in settings if samples and name.endswith("samples")]
    return {**settings, **{name: min(settings[name], samples or 0) for name in counts}}


def require_snakemake() -> None:
    """Refuse a Python without Snakemake."""
    if not importlib.util.find_spec("snakemake"):
        msg = (
            f"found no snakemake in {sys.executable}, expected version 9 or newer; install it by"
            f" '{sys.executable} -m pip install --group sweep' in the clone"
        )
        raise ValueError(msg)


def command_of(workflow: Path, options: Namespace) -> list[str]:
    """Return the command line of Snakemake.

    It does not lock the folder, which would stay locked after a kill; `held` does.
    """
    words = ["-s", str(workflow), "--directory", str(options.out), "--cores", str(options.jobs)]
    words += ["--config", f"scale={options.scale}"]
    words += [f"samples={options.samples}"] if options.samples else []
    words += [f"figures={','.join(options.figures)}"] if options.figures else []
    words += ["--keep-going", "--rerun-incomplete", "--nolock"]
    words += ["--dry-run"] if options.dry_run else []
    # -P: files in the working directory are not modules.
    return [sys.executable, "-P", "-m", "snakemake", *words]


def require_same(options: Namespace) -> None:
    """Record the settings in the folder, and refuse a folder with other ones.

    Raises
    ------
    ValueError
    """
    note = options.out / "reproduced.json"
    asked = {"paper": options.paper, "scale": options.scale}
    if note.exists():
        found = json.loads(note.read_text(encoding="utf-8"))
        if found != asked:
            told = " at the scale ".join(map(str, found.values()))
            msg = (
                f"{options.out} holds {told}, expected {options.paper} at the scale {options.scale};"
                " choose another --out"
            )
            raise ValueError(msg)
    note.write_text(json.dumps(asked) + "\n", encoding="utf-8")


@contextmanager
def held(folder: Path) -> Iterator[IO[str]]:
    """Hold a folder while the yielded file is open, here or in a process that inherits it.

    Raises
    ------
    ValueError
        If another process holds it.
    """
    with (folder / "held").open("w", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            msg = f"another process makes files in {folder}, expected none; wait until it ends"
            raise ValueError(msg) from None
        except OSError:  # a file system without locks
            pass
        yield file


@contextmanager
def _ended_after(
    seconds: float | None, going: subprocess.Popen[str], late: threading.Event
) -> Iterator[None]:
    """End Snakemake after a time, as Ctrl-C does; its jobs resume from their own files."""

    def end() -> None:
        late.set()
        going.send_signal(signal.SIGINT)

    timer = threading.Timer(seconds or 0.0, end)
    if seconds is not None:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def steps(command: list[str], options: Namespace, lock: IO[str]) -> Iterator[Step]:
    """Run Snakemake, log its output, and yield its progress.

    Raises
    ------
    RuntimeError
        If it fails for another reason than a job.
    """
    going = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        pass_fds=(lock.fileno(),),
        env=os.environ | {"PYTHONPATH": python_path()},
    )
    at, failed, failing, last = Step(), 0, False, ""
    late = threading.Event()
    assert going.stdout is not None
    with (
        _ended_after(options.seconds, going, late),
        going,
        (options.out / "snakemake.log").open("a", encoding="utf-8") as log,
    ):
        try:
            for line in going.stdout:
                log.write(line)
                last = line.strip() or last
                if found := _DONE.match(line):
                    at = Step(int(found[1]), int(found[2]))
                    yield at
                failing = line.startswith("Error in rule") or (failing and bool(line.strip()))
                if failing and not late.is_set() and (found := _OUTPUT.match(line)):
                    failed += 1
                    yield at._replace(failed=f"{found[1]}: {last_words(options.out, found[1])}")
        except BaseException:
            # Snakemake then ends its jobs, which resume from their own files.
            going.send_signal(signal.SIGINT)
            going.wait(_PATIENCE)
            raise
    if late.is_set():
        msg = (
            f"{options.out}: stopped after {options.seconds:.3g} s at {at.done} of {at.of} jobs, expected the end; the"
            " same command resumes"
        )
        raise TimeLimitError(msg)
    if going.returncode and not failed:
        msg = f"Snakemake ended with exit code {going.returncode} with the message: {last}; see {log.name}"
        raise RuntimeError(msg)


def planned(command: list[str]) -> list[str]:
    """List the jobs to run.

    Raises
    ------
    RuntimeError
        If Snakemake refuses the workflow.
    """
    env = os.environ | {"PYTHONPATH": python_path()}
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=env)
    said = (done.stdout + done.stderr).strip().splitlines()
    if done.returncode:
        msg = f"Snakemake ended with exit code {done.returncode} with the message: {said[-1]}"
        raise RuntimeError(msg)
    return sorted(found[1] for found in map(_OUTPUT.match, said) if found)


def last_words(folder: Path, job: str) -> str:
    """Return the last line that a job printed."""
    log = folder / "logs" / f"{job}.err"
    lines = log.read_text(encoding="utf-8", errors="replace").replace("\r", "\n").split("\n")
    said = [line for line in lines if line.strip()]
    return said[-1] if said else f"no message in {log}"


def page_of_what_is_there(workflow: Path, options: Namespace) -> None:
    """Write the page even if figures are missing."""
    script = workflow.parents[1] / "agreement.py"
    words = [str(options.out), "--paper", workflow.parent.name, "--scale", options.scale]
    words += ["--samples", str(options.samples)] if options.samples else []
    subprocess.run(
        [sys.executable, str(script), *words, "--out", str(options.out / _PAGE)],
        check=False,
        stdout=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": python_path()},
    )


def verdicts(table: Path) -> dict[str, int]:
    """Count the verdicts of a table of agreement."""
    if not table.exists():
        return {}
    with table.open(newline="", encoding="utf-8") as file:
        return dict(Counter(row["verdict"] for row in csv.DictReader(file)))


def main(options: Namespace) -> int:
    """Make all missing results; return the exit code."""
    if options.jobs < 1:
        msg = f"--jobs is {options.jobs}, expected at least 1"
        raise ValueError(msg)
    if options.samples is not None and options.samples < 1:
        msg = f"--samples is {options.samples}, expected at least 1"
        raise ValueError(msg)
    if options.seconds is not None:
        require_in("--seconds", options.seconds, RANGES["seconds"])
    workflow = workflow_of(options.paper)
    require_snakemake()
    options.out = options.out or Path("runs") / f"{options.paper}_{options.scale}"
    options.out.mkdir(parents=True, exist_ok=True)
    failures: list[str] = []

    def told(step: Step) -> Told:
        failures.extend([step.failed] * bool(step.failed))
        text = f"{step.done} of {step.of}" + (f", {len(failures)} failed" if failures else "")
        return Told("jobs", text, step.done / step.of if step.of else None, step.failed or None)

    began = time.perf_counter()
    with held(options.out) as lock:
        require_same(options)
        command = command_of(workflow, options)
        if options.dry_run:
            report({"out": options.out, "planned": planned(command)})
            return 0
        follow(steps(command, options, lock), told)
        if failures or not (options.out / _PAGE).exists():
            page_of_what_is_there(workflow, options)
    figures = len(list((options.out / "figures").glob("*.png")))
    found = {"out": options.out, "page": options.out / _PAGE, "figures": figures}
    found |= {"numbers": verdicts(options.out / _TABLE), "failed": failures}
    report(found | {"wall_seconds": time.perf_counter() - began})
    return 0 if figures and not failures else 1
