"""Initial packings of runs."""

from __future__ import annotations

import hashlib
import os
import warnings
from typing import Any, NamedTuple

import numpy as np

from jamshape.checks import ArgumentError, require_no_effect, require_one_of, require_stated
from jamshape.files.disk import named
from jamshape.front.packing import Packing
from jamshape.front.reading import Held, packing_of
from jamshape.packing import Packing as PackingLike
from jamshape.protocols.random_start import start_below
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction, Stiffness, law_text, stiffness_text


def start_of(start: Held, sides: int = 2) -> Packing:
    """Return the initial packing, as `packing_of`, under the law of the run.

    Warns if the default number of side-to-side bonds differs from that of the start.
    """
    known = packing_of(start)
    if known.law.sides == sides:
        return known
    # `sides` was given explicitly.
    is_asked = sides != Interaction().sides
    if not is_asked and known.compiled().has_sides and not known.is_round.all():
        said = (
            f"the start has sides={known.law.sides} (bonds of a side-to-side contact) and the run"
            f" sides={sides}: energy and forces of the start change"
        )
        warnings.warn(said, stacklevel=4)
    law = known.law.but(sides=sides)
    return known.with_(law=law, results=known.results, file=known.file)


def require_known_kinks(sides: int, dimension: int) -> None:
    """Refuse the law on whose kinks implicit steps would end."""
    if sides != 2 and dimension != 2:
        said = "implicit steps in 3D do not take {sides}, expected 2; choose another integrator"
        raise ArgumentError(said, {"sides": sides})


def told_of(start: Packing) -> dict[str, Any]:
    """Return metadata on the particles of a start and on its source."""
    own = [parameter.name for parameter in start.shape.parameters]
    names, results = (*own, "size_ratio", "kinds", "law", "seed"), start.results
    found = {name: results[name] for name in names if name in results}
    # As UTF-8, whatever the locale: names may hold bytes that it cannot decode.
    name = os.fsencode(named(start.file)).decode(errors="replace") if start.file else digest(start)
    # The digest distinguishes frames of one file.
    return found | {
        "n": start.n,
        "start": name,
        "start_digest": digest(start),
        "phi_start": start.phi,
    }


def digest(start: PackingLike) -> str:
    """Name a packing without a file by its poses, and k_e other than 1 and laws other than harmonic, to distinguish it from another one."""
    poses = b"".join(np.ascontiguousarray(x, np.float64).tobytes() for x in start.poses())
    if start.law.k_e != Interaction().k_e:
        poses += stiffness_text(start.law.k_e).encode()
    if start.law.power != Interaction().power:
        poses += law_text(start.law.power).encode()
    return f"packing {hashlib.blake2b(poses, digest_size=8).hexdigest()}"


class Asked(NamedTuple):
    """Arguments of a random start; None for defaults."""

    n: int | None
    phi: float | None
    seed: int | None
    dimension: int | None = None


class Start(NamedTuple):
    """Initial state of a run: a packing, or particles with the settings of a random start."""

    known: Packing | None
    particles: Particles | None
    n: int
    phi: float
    seed: int
    dimension: int
    phi_name: str
    """Name of `phi` in files."""

    @classmethod
    def of(
        cls,
        particles: Particles | None,
        asked: Asked,
        start: Held | None,
        *,
        usual_phi: float,
        sides: int = 2,
        phi_name: str = "phi_start",
    ) -> Start:
        """Take a start, which excludes other arguments, or particles with defaults."""
        require_no_effect("start", start, particles=particles, **asked._asdict())
        given = {name: value for name, value in asked._asdict().items() if value is not None}
        require_one_of("dimension", given.get("dimension", 2), (2, 3))
        require_stated(**{name: value for name, value in given.items() if name != "dimension"})
        numbers = {"n": 256, "phi": usual_phi, "seed": 1, "dimension": 2} | given
        known = None if start is None else start_of(start, sides)
        if known:
            numbers["dimension"] = known.dimension
        elif particles is None:
            msg = "neither particles nor a start are given, expected one of them"
            raise ValueError(msg)
        return cls(known, particles, **numbers, phi_name=phi_name)

    @property
    def k_e(self) -> Stiffness:
        """Stiffness of the contacts, [energy]."""
        return self.known.law.k_e if self.known else Interaction().k_e

    @property
    def made_from(self) -> dict[str, Any]:
        """Describe the particles and the start."""
        if self.known:
            return told_of(self.known)
        assert self.particles
        own = {"n": self.n, self.phi_name: self.phi, "seed": self.seed}
        return self.particles.identity | own

    def random(self) -> PackingLike:
        """Make a random start at the packing fraction asked for, or one that random insertion reaches."""
        assert self.particles
        return start_below(self.phi, self.n, self.seed, self.particles, self.dimension)
