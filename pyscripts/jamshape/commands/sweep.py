"""Make many packings on all cores, several samples of all particles that are asked for.

    jamshape sweep --alpha 0 0.01 1 4 --samples 6 --n 256 --out sweep/
    jamshape sweep --superellipsoid 1 0.6 1 --superellipsoid 1.5 1 1 --samples 5 --n 400 --out sweep3d/
    jamshape sweep --kind alpha=0 --kind alpha=4,size=1.4 --samples 5 --n 256 --out mixtures/

Each sample is one run of `jamshape pack` in a process of its own, one a core. Started again after a kill it
goes on: packings that are there are not made again, those under way go on from their own files, and those of
other parameters are refused. A sample that fails is listed, the others go on. The last line of standard output is one JSON
object; the exit code is 0 only if all samples are there. For clusters see pyscripts/sweep.smk.
"""

from __future__ import annotations

import concurrent.futures
import os
import subprocess
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from jamshape.command import report
from jamshape.commands import pack
from jamshape.shapes.shape import Shape
from jamshape.shapes.table import DEFAULT, SHAPES, shape_named

# -P: what lies in the working directory is no module of ours.
_PACK = (sys.executable, "-P", "-m", "jamshape", "pack")

# One core a process: threads of BLAS would only wait for each other.
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

GO_ON = "the same command goes on from the files of the packings"


class _Parser(ArgumentParser):
    """Keeps the options that it does not know, which are those of a packing."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        options, extra = super().parse_known_args(args, namespace)
        options.extra = extra
        if not particles(options):
            self.error("no particles were given, expected --alpha, --kind or the name of a shape")
        self._require_options_of_a_packing(options)
        return options, []

    def _require_options_of_a_packing(self, options: Namespace) -> None:
        """Refuse what no packing can be made with, before many are begun."""
        parser = pack.options_of()
        parser.prog = self.prog
        for particle in particles(options):
            parser.parse_args(arguments_of(particle, 1, options))


def options_of() -> ArgumentParser:
    """Make the parser; what it does not know goes to each packing."""
    parser = _Parser(
        description=__doc__,
        formatter_class=RawDescriptionHelpFormatter,
        epilog="Other options (--n, --u0, --kappa ...) are those of jamshape pack.",
    )
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help="aspect ratios A/R")
    parser.add_argument("--shape", choices=SHAPES, default=DEFAULT, help="of --alpha and --kind")
    parser.add_argument("--kind", action="append", default=[], help="one mixture, of these kinds")
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
    parser.add_argument("--samples", type=int, default=6, help="seeds 1 to this (6)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes (all cores)")
    parser.add_argument("--out", type=Path, required=True, help="folder")
    return parser


class Particle(NamedTuple):
    """What packings are of: how their files are called, and the options of its packing."""

    name: str
    arguments: list[str]


def particles(options: Namespace) -> list[Particle]:
    """List the particles that are asked for."""
    shape = shape_named(options.shape)
    found = [particle_of(shape, {"alpha": alpha}) for alpha in options.alpha]
    for other in SHAPES.values():
        names = [p.name for p in other.parameters]
        given = getattr(options, other.name)
        found += [particle_of(other, dict(zip(names, v, strict=True))) for v in given]
    if options.kind:
        kinds = [text for kind in options.kind for text in ("--kind", kind)]
        found.append(Particle("mixture", ["--shape", shape.name, *kinds]))
    return found


def particle_of(shape: Shape, parameters: dict[str, float]) -> Particle:
    """Name particles of a shape."""
    told = ["--shape", shape.name]
    for parameter in shape.parameters:
        told += [f"--{parameter.option}", repr(parameters[parameter.name])]
    return Particle(shape.stem(parameters), told)


def file_of(particle: Particle, seed: int, options: Namespace) -> Path:
    """Name the file of a sample."""
    return Path(options.out / f"{particle.name}_seed{seed}.h5")


def arguments_of(particle: Particle, seed: int, options: Namespace) -> list[str]:
    """List the options of a sample."""
    out = file_of(particle, seed, options)
    return [*particle.arguments, "--seed", str(seed), "--out", str(out), *options.extra]


def make(particle: Particle, seed: int, options: Namespace) -> str | None:
    """Make one sample; return its complaint if it fails."""
    out = file_of(particle, seed, options)
    log = out.with_suffix(".log")
    with log.open("a") as errors:
        done = subprocess.run(
            [*_PACK, *arguments_of(particle, seed, options)],
            check=False,
            stdout=subprocess.PIPE,
            stderr=errors,
            env=os.environ | _ONE_THREAD | {"PYTHONPATH": _python_path()},
        )
    if done.stdout.strip():  # a finished packing, which says itself whether it is in equilibrium
        return None
    last = log.read_text().strip().replace("\r", "\n").splitlines()
    return f"{out.name}: {last[-1] if last else f'exit code {done.returncode}'}"


def _python_path() -> str:
    """Folders in which a process finds this jamshape before any other."""
    before = os.environ.get("PYTHONPATH")
    return os.pathsep.join([str(Path(__file__).parents[2]), *([before] if before else [])])


def main(options: Namespace) -> int:
    """Run all samples; return the exit code."""
    options.out.mkdir(parents=True, exist_ok=True)
    samples = [(p, s) for s in range(1, options.samples + 1) for p in particles(options)]
    failures = []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        runs = [pool.submit(make, particle, seed, options) for particle, seed in samples]
        try:
            for run in tqdm(concurrent.futures.as_completed(runs), total=len(runs), unit="packing"):
                if complaint := run.result():
                    failures.append(complaint)
                    tqdm.write(complaint, file=sys.stderr)
        except KeyboardInterrupt:  # those under way end by themselves
            pool.shutdown(cancel_futures=True)
            raise
    done = len(samples) - len(failures)
    report({"out": options.out, "made": done, "failed": failures})
    return 1 if failures else 0
