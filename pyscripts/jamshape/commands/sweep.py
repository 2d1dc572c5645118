"""Make many packings on all cores, several samples for each choice of particles.

    jamshape sweep --alpha 0 0.01 1 4 --samples 6 --n 256 --out sweep/ --plot sweep.png
    jamshape sweep --superellipsoid 1 0.6 1 --superellipsoid 1.5 1 1 --samples 5 --n 400 --out sweep3d/
    jamshape sweep --kind alpha=0 --kind alpha=4,size=1.4 --samples 5 --n 256 --out mixtures/
    jamshape sweep --alpha 4 --first-seed 101 --samples 20 --n 256 --out sweep/

Each sample is one run of `jamshape pack` in one of a few processes, one a core, which end with the sweep,
however that ends. The same command resumes after a kill: finished packings are kept, unfinished ones continue from
their files, and those of other parameters are refused. A sample that fails, or whose forces do not balance, is listed
as failed, and the others continue. The last line of standard output is one JSON object: made and not_made count
packings, not_reached those whose forces do not balance. The exit code is 0 only if nothing failed, and 75 if
--seconds stopped packings before their ends. For clusters see docs/how-to/cluster.md.
"""

from __future__ import annotations

import fcntl
import os
import sys
import time
from argparse import Action, ArgumentError, ArgumentParser, Namespace
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import IO, Any, NamedTuple

from jamshape.checks import RANGES, TIME_IS_UP, require_folder, require_in
from jamshape.command import Parser, report
from jamshape.commands import main as command
from jamshape.commands import pack
from jamshape.drawing.saving import require_picture, save_figure
from jamshape.drawing.sweep import sweep_figure
from jamshape.files.ensembles import PackingFile
from jamshape.front.progress import follow
from jamshape.recording.driver import Told
from jamshape.recording.workers import Workers, cores
from jamshape.shapes.shape import Shape
from jamshape.shapes.table import DEFAULT, SHAPES, shape_named

_SAMPLE = f"{__name__}:sample"

# How long a sample waits for another process that makes it, such as one of a killed sweep.
_PATIENCE = 5.0

GO_ON = "the same command resumes from the files of the packings"


class _Parser(Parser):
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


class _Parameters(Action):
    """Reads the parameters of a shape, numbers and texts, and collects them by name."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: Any = None) -> None:
        del parser, option_string
        shape = SHAPES[self.dest]
        try:
            read = {p.name: p.told(v) for p, v in zip(shape.needed, values, strict=True)}
        except ValueError as error:
            raise ArgumentError(self, str(error)) from error
        setattr(namespace, self.dest, [*getattr(namespace, self.dest), read])


def options_of() -> ArgumentParser:
    """Make the parser; unknown options go to each packing."""
    parser = _Parser(
        description=__doc__,
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
            nargs=len(shape.needed),
            action=_Parameters,
            default=[],
            metavar=tuple(p.option.upper() for p in shape.needed),
            help=f"{', '.join(p.meaning for p in shape.needed)}; may be given several times",
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
    parser.add_argument(
        "--plot", type=Path, help="picture of phi_J and z against the swept parameter"
    )
    return parser


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
        found += [particle_of(other, given) for given in getattr(options, other.name)]
    if options.kind:
        kinds = [text for kind in options.kind for text in ("--kind", kind)]
        told = ["--shape", shape.name, *kinds]
        found.append(Particle("mixture", told, told))
    return list({particle.name: particle for particle in found}.values())


def particle_of(shape: Shape, parameters: Mapping[str, Any]) -> Particle:
    """Name particles of a shape."""
    told, asked = ["--shape", shape.name], [f"--{shape.name}"]
    for parameter in shape.needed:
        value = parameters[parameter.name]
        text = value if isinstance(value, str) else repr(value)
        told += [f"--{parameter.option}", text]
        asked.append(text)
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


class Complaint(NamedTuple):
    """Fault of a sample."""

    said: str
    is_made: bool = False
    """Whether its packing exists, but did not reach its goal."""
    is_late: bool = False
    """Whether its time was up."""


def sample(arguments: list[str], out: Path, until: float | None) -> Complaint | None:
    """Make one sample in this process; return its complaint if it fails or does not reach its goal.

    Parameters
    ----------
    arguments : list of str
        Options of `jamshape pack`.
    out : Path
        File of the sample; messages go to its log, which is locked meanwhile.
    until : float, optional
        Time of `time.monotonic` at which to stop.
    """
    seconds = None if until is None else until - time.monotonic()
    if seconds is not None and seconds <= 0 and not out.exists():
        return Complaint(f"{out.name}: not begun in time", is_late=True)
    left = [] if seconds is None else ["--seconds", f"{max(0.0, seconds):.3f}"]
    path = out.with_suffix(".log")
    with path.open("a") as log:
        if not _is_ours(log):
            said = f"{out.name}: another process is making it, expected none; wait until it ends"
            return Complaint(said)
        with _standard_error_to(log), redirect_stdout(StringIO()) as told:
            code = _exit_code(["pack", *arguments, *left])
    if not code:
        return None
    last = path.read_text().strip().replace("\r", "\n").splitlines()
    said = f"{out.name}: {last[-1] if last else f'exit code {code}'}"
    return Complaint(said, is_made=bool(told.getvalue().strip()), is_late=code == TIME_IS_UP)


def _exit_code(arguments: list[str]) -> int:
    """Run a command in this process."""
    try:
        command(arguments)
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
            return 1
        return end.code or 0


@contextmanager
def _standard_error_to(log: IO[str]) -> Iterator[None]:
    """Send what Python and libraries print to a log."""
    sys.stderr.flush()
    before = os.dup(2)
    os.dup2(log.fileno(), 2)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(before, 2)
        os.close(before)


def _is_ours(log: IO[str]) -> bool:
    """Lock the log of a sample, for as long as it is open."""
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


def made(options: Namespace) -> Iterator[Complaint | None]:
    """Make all samples, and yield the complaint of each, or None, when it ends."""
    tasks = [
        (arguments_of(particle, seed, options), file_of(particle, seed, options), options.until)
        for seed in seeds(options)
        for particle in particles(options)
    ]
    with Workers(_SAMPLE, tasks, options.jobs, label=f"samples of {options.out}") as workers:
        for done in workers:
            name = tasks[done.number][1].name
            yield Complaint(f"{name}: {done.failure}") if done.failure else done.result


def _plot(options: Namespace) -> None:
    """Draw the packings that were made."""
    files = [file_of(p, s, options) for p in particles(options) for s in seeds(options)]
    if made := [PackingFile.read(file) for file in files if file.exists()]:
        save_figure(sweep_figure(made), options.plot)


def main(options: Namespace) -> int:
    """Run all samples; return the exit code."""
    if options.seconds is not None:
        require_in("--seconds", options.seconds, RANGES["seconds"])
    require_folder(options.out)
    if options.plot:
        require_picture(options.plot)
    options.out.mkdir(parents=True, exist_ok=True)
    options.until = None if options.seconds is None else time.monotonic() + options.seconds
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
    if options.plot:
        _plot(options)
    missing = sum(not complaint.is_made for complaint in failures)
    found = {"out": options.out, "made": total - missing, "not_made": missing}
    found |= {"not_reached": len(failures) - missing}
    report(found | {"failed": [complaint.said for complaint in failures]})
    if any(complaint.is_late for complaint in failures):
        return TIME_IS_UP
    return 1 if failures else 0
