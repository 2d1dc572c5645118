"""Packings that runs begin with."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any, NamedTuple

from jamshape.checks import require_no_effect, require_one_of, require_stated
from jamshape.files.disk import named
from jamshape.front.packing import MeasuredPacking
from jamshape.packing import Packing
from jamshape.protocols.random_start import random_packing, start_below
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction


def start_of(start: Packing | str | Path, sides: int = 2) -> MeasuredPacking:
    """Take the packing to begin with, of a path its last frame, under the law that the run has.

    Warns where the usual bonds of side-to-side contacts are not those that the start has.
    """
    if isinstance(start, str | Path):
        start = MeasuredPacking.read(Path(start))
    known = start if isinstance(start, MeasuredPacking) else MeasuredPacking.of(start)
    if known.law.sides == sides:
        return known
    # Other ones than the usual were asked for.
    is_asked = sides != Interaction().sides
    if not is_asked and known.compiled().has_sides and not known.is_round.all():
        said = (
            f"the start has sides={known.law.sides}, bonds of a side-to-side contact, and the run has"
            f" sides={sides}: energy and forces of the start change"
        )
        warnings.warn(said, stacklevel=4)
    law = known.law.but(sides=sides)
    return known.with_(law=law, results=known.results, file=known.file)


def told_of(start: MeasuredPacking) -> dict[str, Any]:
    """Pick what is said of the particles of a start, and where it is from."""
    own = [parameter.name for parameter in start.shape.parameters]
    names, results = (*own, "size_ratio", "kinds", "seed"), start.results
    found = {name: results[name] for name in names if name in results}
    # As UTF-8, whatever the locale: names may hold bytes that it cannot read.
    name = os.fsencode(named(start.file)).decode(errors="replace") if start.file else ""
    return found | {"n": start.n, "start": name}


class Asked(NamedTuple):
    """What was given of a random start."""

    n: int | None
    phi: float | None
    seed: int | None
    dimension: int | None = None


class Start(NamedTuple):
    """What a run begins with: a packing, or particles with the numbers of a random start."""

    known: MeasuredPacking | None
    particles: Particles | None
    n: int
    phi: float
    seed: int
    dimension: int
    phi_name: str
    """Of the packing fraction in files; empty where it is not of the start alone."""

    @classmethod
    def of(
        cls,
        particles: Particles | None,
        asked: Asked,
        start: Packing | str | Path | None,
        *,
        usual_phi: float,
        sides: int = 2,
        phi_name: str = "",
    ) -> Start:
        """Take a start, beside which nothing else may be given, or particles with what is usual."""
        require_no_effect("start", start, particles=particles, **asked._asdict())
        given = {name: value for name, value in asked._asdict().items() if value is not None}
        require_one_of("dimension", given.get("dimension", 2), (2, 3))
        require_stated(**{name: value for name, value in given.items() if name != "dimension"})
        numbers = {"n": 256, "phi": usual_phi, "seed": 1, "dimension": 2} | given
        known = None if start is None else start_of(start, sides)
        if known:
            numbers["dimension"] = known.dimension
        elif particles is None:
            msg = "there are neither particles nor a start, expected one of them"
            raise ValueError(msg)
        return cls(known, particles, **numbers, phi_name=phi_name)

    @property
    def k_e(self) -> float:
        """Stiffness of the contacts, [energy]."""
        return self.known.law.k_e if self.known else Interaction().k_e

    @property
    def made_from(self) -> dict[str, Any]:
        """Tell what the run is of."""
        if self.known:
            return told_of(self.known)
        assert self.particles
        phi = {self.phi_name: self.phi} if self.phi_name else {}
        return dict(self.particles.told) | {"n": self.n} | phi | {"seed": self.seed}

    def random(self, phi: float | None = None) -> Packing:
        """Make the random start, of a packing fraction at which it is found, or the one that was asked for at most."""
        assert self.particles
        if phi is not None:
            return random_packing(self.n, phi, self.seed, self.particles, self.dimension)
        return start_below(self.phi, self.n, self.seed, self.particles, self.dimension)
