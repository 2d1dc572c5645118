"""Make many packings on all cores, several samples for each choice of particles.

    jamshape sweep --alpha 0 0.01 1 4 --samples 6 --n 256 --out sweep/
    jamshape sweep --superellipsoid 1 0.6 1 --superellipsoid 1.5 1 1 --samples 5 --n 400 --out sweep3d/
    jamshape sweep --kind alpha=0 --kind alpha=4,size=1.4 --samples 5 --n 256 --out mixtures/
    jamshape sweep --alpha 4 --first-seed 101 --samples 20 --n 256 --out sweep/

Each sample is one run of `jamshape pack` in its own process, one a core, which ends with the sweep,
however that ends. The same command resumes after a kill: finished packings are kept, unfinished ones continue from
their files, and those of other parameters are refused. A sample that fails, or whose forces do not balance, is listed
as failed, and the others continue. The last line of standard output is one JSON object: made and not_made count
packings, not_reached those whose forces do not balance. The exit code is 0 only if nothing failed, and 75 if
--seconds stopped packings before their ends. For clusters see docs/how-to/cluster.md.
"""

from __future__ import annotations

import concurrent.futures
import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from jamshape.checks import RANGES, TIME_IS_UP, require_in
from jamshape.command import report
from jamshape.commands import main as command
from jamshape.commands import pack
from jamshape.front.progress import follow
from jamshape.recording.driver import Told
from jamshape.shapes.shape import Shape
from jamshape.shapes.table import DEFAULT, SHAPES, shape_named

# -P: files in the working directory are not modules of ours.
_PACK = (sys.executable, "-P", "-c", "from jamshape.commands.sweep import sample; sample()")

# One core a process: BLAS threads would only compete.
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

# How long a sample waits for another process that makes it, such as one of a killed sweep.
_PATIENCE = 5.0

GO_ON = "the same command resumes from the files of the packings"


class _Parser(ArgumentParser):
    """Passes unknown options on to each packing."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        options, extra = super().parse_known_args(args, namespace)
        options.extra = extra
        for name, least in (("samples", 1), ("jobs", 1), ("first_seed", 0)):
            if (value := getattr(options, name)) < least:
                self.error(f"--{name.replace('_', '-')} is {value}, expected at least {least}")
        if not particles(options):
            self.error("no particles were given, expected --alpha, --kind or the name of a shape")
        if options.shape and not (options.alpha or options.kind):
            self.error(
                f"--shape {options.shape} has no effect without --alpha or --kind, expected one of them"
            )
        self._require_options_of_a_packing(options)
        return options, []

    def _require_options_of_a_packing(self, options: Namespace) -> None:
        """Refuse invalid options of a packing before many are begun."""
        parser = pack.options_of()
        parser.prog = self.prog
        given = parser.parse_args(["--out", "of a sample", *options.extra], Namespace(seed=None))
        if given.seed is not None:
            self.error(
                f"--seed is {given.seed}, which has no effect on a sweep: its samples have the"
                " seeds from --first-seed on, one for each of --samples"
            )
        if given.start is not None:
            self.error(
                f"--start is {given.start}, which has no effect on a sweep: its samples differ in their seed"
            )
        for particle in particles(options):
            parser.parse_args(arguments_of(particle, 1, options))


def options_of() -> ArgumentParser:
    """Make the parser; unknown options go to each packing."""
    parser = _Parser(
        description=__doc__,
        formatter_class=RawDescriptionHelpFormatter,
        epilog="Other options (--n, --u0, --kappa ...) are those of jamshape pack.",
    )
    parser.add_argument(
        "--alpha", type=float, nargs="+", action="extend", default=[], help="aspect ratios A/R"
    )
    parser.add_argument("--shape", choices=SHAPES, help=f"shape for --alpha and --kind ({DEFAULT})")
    parser.add_argument("--kind", action="append", default=[], help="kinds of one mixture")
    for shape in SHAPES.values():
        parser.add_argument(
            f"--{shape.name}",
            type=float,
            nargs=len(shape.parameters),
            action="append",
            default=[],
            metavar=tuple(p.option.upper() for p in shape.parameters),
            help=f"{', '.join(p.meaning for p in shape.parameters)}; may be given several times",
        )
    parser.add_argument(
        "--samples", type=int, default=6, help="samples of each, with one seed each (6)"
    )
    parser.add_argument(
        "--first-seed",
        type=int,
        default=1,
        help="seed of the first sample; the next has one more (1)",
    )
    parser.add_argument("--jobs", type=int, default=cores(), help="processes (all cores)")
    parser.add_argument("--out", type=Path, required=True, help="folder")
    parser.add_argument(
        "--seconds", type=float, help="time after which packings stop at their next checkpoints"
    )
    return parser


def cores() -> int:
    """Count the cores available to this process, in a cluster job possibly fewer than those of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Particle(NamedTuple):
    """Particles of packings: name of their files, and options that specify them."""

    name: str
    arguments: list[str]
    """Options for a packing."""
    asked: list[str]
    """Options for a sweep of these particles alone."""


def particles(options: Namespace) -> list[Particle]:
    """List the requested particles, each once."""
    shape = shape_named(options.shape or DEFAULT)
    found = [particle_of(shape, {"alpha": alpha}) for alpha in options.alpha]
    for other in SHAPES.values():
        names = [p.name for p in other.parameters]
        given = getattr(options, other.name)
        found += [particle_of(other, dict(zip(names, v, strict=True))) for v in given]
    if options.kind:
        kinds = [text for kind in options.kind for text in ("--kind", kind)]
        told = ["--shape", shape.name, *kinds]
        found.append(Particle("mixture", told, told))
    return list({particle.name: particle for particle in found}.values())


def particle_of(shape: Shape, parameters: dict[str, float]) -> Particle:
    """Name particles of a shape."""
    told, asked = ["--shape", shape.name], [f"--{shape.name}"]
    for parameter in shape.parameters:
        number = repr(parameters[parameter.name])
        told += [f"--{parameter.option}", number]
        asked.append(number)
    return Particle(shape.stem(parameters), told, asked)


def seeds(options: Namespace) -> range:
    """List the seeds of the samples."""
    return range(options.first_seed, options.first_seed + options.samples)


def file_of(particle: Particle, seed: int, options: Namespace) -> Path:
    """Name the file of a sample."""
    return Path(options.out / f"{particle.name}_seed{seed}.h5")


def arguments_of(particle: Particle, seed: int, options: Namespace) -> list[str]:
    """List the options of a sample."""
    out = file_of(particle, seed, options)
    return [*particle.arguments, "--seed", str(seed), "--out", str(out), *options.extra]


class Leash(NamedTuple):
    """A pipe without writer: when the sweep ends, the samples, which read it, see its end."""

    read: int
    write: int

    @classmethod
    def new(cls) -> Leash:
        """Create the pipe."""
        return cls(*os.pipe())

    def let_go(self) -> None:
        """End all samples."""
        os.close(self.write)


def sample() -> None:
    """Make one sample in a process of its own, which ends with the sweep that holds its standard input."""

    def end_with_the_sweep() -> None:
        os.read(0, 1)
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=end_with_the_sweep, daemon=True).start()
    command(["pack", *sys.argv[1:]])


class Complaint(NamedTuple):
    """Fault of a sample."""

    said: str
    is_made: bool = False
    """Whether its packing exists, but did not reach its goal."""
    is_late: bool = False
    """Whether its time was up."""


def make(particle: Particle, seed: int, options: Namespace, leash: Leash) -> Complaint | None:
    """Make one sample; return its complaint if it fails or does not reach its goal."""
    out, left = file_of(particle, seed, options), []
    if options.seconds is not None:
        seconds = options.until - time.monotonic()
        if seconds <= 0 and not out.exists():
            return Complaint(f"{out.name}: not begun in time", is_late=True)
        left = ["--seconds", f"{max(0.0, seconds):.3f}"]
    log = out.with_suffix(".log")
    with log.open("a") as errors:
        if not _is_ours(errors):
            said = f"{out.name}: another process is making it, expected none; wait until it ends"
            return Complaint(said)
        done = subprocess.run(
            [*_PACK, *arguments_of(particle, seed, options), *left],
            check=False,
            stdin=leash.read,
            stdout=subprocess.PIPE,
            stderr=errors,
            env=os.environ | _ONE_THREAD | {"PYTHONPATH": python_path()},
        )
    if not done.returncode:
        return None
    last = log.read_text().strip().replace("\r", "\n").splitlines()
    said = f"{out.name}: {last[-1] if last else f'exit code {done.returncode}'}"
    is_late = done.returncode == TIME_IS_UP
    return Complaint(said, is_made=bool(done.stdout.strip()), is_late=is_late)


def _is_ours(log: IO[str]) -> bool:
    """Lock the log of a sample, for as long as it is open here or in the process that makes the sample."""
    until = time.monotonic() + _PATIENCE
    while True:
        try:
            fcntl.flock(log, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > until:
                return False
            time.sleep(0.05)
        except OSError:  # a file system without locks
            return True
        else:
            return True


def python_path() -> str:
    """Return the search path on which a process finds this jamshape first."""
    before = os.environ.get("PYTHONPATH")
    return os.pathsep.join([str(Path(__file__).parents[2]), *([before] if before else [])])


def made(options: Namespace) -> Iterator[Complaint | None]:
    """Make all samples, and yield the complaint of each, or None, when it ends."""
    samples = [(p, s) for s in seeds(options) for p in particles(options)]
    leash = Leash.new()
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        runs = [pool.submit(make, particle, seed, options, leash) for particle, seed in samples]
        try:
            for run in concurrent.futures.as_completed(runs):
                yield run.result()
        except BaseException:
            leash.let_go()
            pool.shutdown(cancel_futures=True)
            raise


def main(options: Namespace) -> int:
    """Run all samples; return the exit code."""
    if options.seconds is not None:
        require_in("--seconds", options.seconds, RANGES["seconds"])
    options.out.mkdir(parents=True, exist_ok=True)
    options.until = time.monotonic() + (options.seconds or 0.0)
    total, done = options.samples * len(particles(options)), 0
    failures: list[Complaint] = []

    def told(complaint: Complaint | None) -> Told:
        nonlocal done
        done += 1
        if complaint:
            failures.append(complaint)
        failed = f", {len(failures)} failed" if failures else ""
        aside = complaint and complaint.said
        return Told("packings", f"{done} of {total}{failed}", done / total, aside)

    follow(made(options), told)
    missing = sum(not complaint.is_made for complaint in failures)
    found = {"out": options.out, "made": total - missing, "not_made": missing}
    found |= {"not_reached": len(failures) - missing}
    report(found | {"failed": [complaint.said for complaint in failures]})
    if any(complaint.is_late for complaint in failures):
        return TIME_IS_UP
    return 1 if failures else 0
