"""Profile of the core seconds of one packing: steps below jamming, the first jammed state, the search for u0.

    OPENBLAS_NUM_THREADS=1 python analysis/benchmarks/packing_profile.py --alpha 4 --n 1024
    OPENBLAS_NUM_THREADS=1 python analysis/benchmarks/packing_profile.py --superellipsoid 1 0.6 1 --n 400

Makes a packing by the usual way and tells of each part how many minimisations it has, their evaluations of all forces,
factorisations and products with the Hessian, seconds in which the processor was busy, how many of these the longest
minimisation takes, and microseconds for each evaluation. What is left over are the random start, the prediction of
where particles go as the box is strained, files, and what is measured on the packing. The last line of standard output
is one JSON object. Functions are told by `perf record -g` before the command.
"""

from __future__ import annotations

import functools
import importlib
import tempfile
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.files.h5md import read_attributes
from jamshape.minima import Minimum, Stop, minimise, target
from jamshape.protocols import quasistatic
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import make
from jamshape.shapes.particles import Particles

BELOW, FIRST, LEADING, REST = (
    "steps below jamming",
    "to the first jammed state",
    "to u0",
    "the rest",
)

# Minimisations of the search that need be no better than this, and may end on kinks, look for a jammed state.
LOOSE = 1e-2


@dataclass
class Part:
    """Cost of one stage."""

    minimisations: int = 0
    evaluations: int = 0
    factorisations: int = 0
    products: int = 0
    seconds: float = 0.0
    longest: float = 0.0

    def told(self) -> list[str]:
        """Make the cells of a table."""
        counts = (self.minimisations, self.evaluations, self.factorisations, self.products)
        each = f"{1e6 * self.seconds / self.evaluations:.3g}" if self.evaluations else ""
        seconds = f"{self.seconds:.2f}", f"{self.longest:.2f}" if self.minimisations else ""
        return [*(str(count) if self.minimisations else "" for count in counts), *seconds, each]


class Profile:
    """Counts what minimisations take."""

    def __init__(self) -> None:
        self.parts = {name: Part() for name in (BELOW, FIRST, LEADING, REST)}
        self._now = self.parts[BELOW]

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count all minimisations of steps and of the search in this process, as long as it is entered."""
        compiled = importlib.import_module("jamshape._contact").LocalEnergyModel
        descend = compiled.descend

        def counted(*arguments: Any) -> Any:
            end = descend(*arguments)
            self._now.factorisations += end.factorisations
            self._now.products += end.products
            return end

        with ExitStack() as patches:
            for patch in (
                mock.patch.object(compiled, "descend", counted),
                mock.patch.object(quasistatic, "minimise", self._counted(searches=False)),
                mock.patch.object(target, "minimise", self._counted(searches=True)),
            ):
                patches.enter_context(patch)
            yield

    def _counted(self, *, searches: bool) -> Callable[..., Minimum]:
        @functools.wraps(minimise)
        def counted(landscape: Any, start: Any, method: str, stop: Stop, *more: Any) -> Minimum:
            is_first = stop.kinks and stop.tolerance >= LOOSE
            name = (FIRST if is_first else LEADING) if searches else BELOW
            part = self._now = self.parts[name]
            before, began = landscape.evaluations, time.process_time()
            found = minimise(landscape, start, method, stop, *more)
            seconds = time.process_time() - began
            part.minimisations += 1
            part.evaluations += landscape.evaluations - before
            part.seconds += seconds
            part.longest = max(part.longest, seconds)
            return found

        return counted


def parser() -> ArgumentParser:
    """Make the parser."""
    found = parser_of(__doc__)
    add = found.add_argument
    add("--alpha", type=float, default=4.0, help="of rods in the plane (4)")
    add("--superellipsoid", type=float, nargs=3, metavar=("P", "W1", "W2"),
        help="in their place, in space")  # fmt: skip
    add("--n", type=int, default=256, help="particles (256)")
    add("--seed", type=int, default=1, help="(1)")
    return found


def main(options: Namespace) -> None:
    """Make the packing and print the table."""
    profile, began = Profile(), time.process_time()
    with profile.counting():
        found = packing_of(particles_of(options), options)
    total = time.process_time() - began
    parts = profile.parts
    parts[REST].seconds = total - sum(part.seconds for part in parts.values())
    counts = "minimisations | evaluations | factorisations | products"
    print(f"| | {counts} | core s | longest | us per evaluation |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, part in parts.items():
        print("| " + " | ".join([name, *part.told()]) + " |")
    told = {name: asdict(part) for name, part in parts.items()}
    report({"n": options.n, "seed": options.seed, "parts": told, "seconds": total} | found)


def particles_of(options: Namespace) -> Particles:
    """Take the shape that was asked for."""
    if options.superellipsoid:
        p, w1, w2 = options.superellipsoid
        return js.Superellipsoids(p=p, w1=w1, w2=w2)
    return js.Spherocylinders(alpha=options.alpha)


def packing_of(particles: Particles, options: Namespace) -> dict[str, Any]:
    """Make the packing, in a folder for the time being, and tell what it is."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "packing.h5"
        make(recipe_for(particles, n=options.n, seed=options.seed), out)
        stored = read_attributes(out)
    return {name: stored[name] for name in ("outcome", "residual", "phi_J", "z") if name in stored}


if __name__ == "__main__":
    run(parser(), main)
