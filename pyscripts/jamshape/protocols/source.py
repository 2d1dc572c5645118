"""A stored compression as the source of packings, with its metadata."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import RANGES, ArgumentError
from jamshape.files.disk import named
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.measures.runs import rate_of
from jamshape.shapes.particles import Particles


class Source(NamedTuple):
    """Metadata of the file of a run for a recipe."""

    path: Path
    particles: Particles
    """Individual particles of the file."""
    n: int
    dimension: int
    seed: int
    """1 if not stored."""
    phi_start: float
    phi_end: float
    """Packing fraction of the last frame."""
    kappa: float
    """Last rate, [1/time]; 0 if not stored."""

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read any H5MD file of particles, a run or a packing; errors as `read_packing`."""
        stored, last = read_attributes(path), read_packing(path)
        given = Particles.given(last.shape, last.diameters, last.form, last.species)
        given = given.under(last.law.power)
        names = [*(one.name for one in last.shape.parameters), "size_ratio", "kinds", "law"]
        told = {name: stored[name] for name in names if name in stored}
        particles = dataclasses.replace(given, told=told) if told else given
        kappa = rate_of(stored) if "kappa" in stored else 0.0
        first = read_packing(path, 0).phi
        low, high = RANGES["phi_start"].low, RANGES["phi_start"].high
        return cls(
            path=Path(path).absolute(),
            particles=particles,
            n=last.n,
            dimension=last.dimension,
            seed=int(stored.get("seed", 1)),
            phi_start=min(max(first, low), high),
            phi_end=last.phi,
            kappa=kappa if math.isfinite(kappa) else 0.0,
        )

    def require(self, particles: Particles | None, **asked: Any) -> None:
        """Raise if a setting differs from that of the start; None is not checked.

        Raises
        ------
        ValueError
        """
        for name, value in asked.items():
            own = getattr(self, name)
            if value is not None and value != own:
                said = f"{{{name}}} differs from {own} of {{start}}; leave it out"
                raise ArgumentError(said, {name: value, "start": named(self.path)})
        if particles is not None and not self._has(particles):
            msg = (
                f"the start {named(self.path)} holds {self.n} particles of {self.particles}, expected those"
                f" requested, {particles}; leave the particles out"
            )
            raise ValueError(msg)

    def _has(self, particles: Particles) -> bool:
        own = self.particles
        if (particles.shape.name, particles.power) != (own.shape.name, own.power):
            return False
        rows, others = (
            np.column_stack([drawn.diameters, drawn.form])
            for p in (own, particles)
            for drawn in [p.sample(self.n, np.random.default_rng(self.seed))]
        )
        return np.array_equal(_sorted(rows), _sorted(others))


def _sorted(rows: FloatArray) -> FloatArray:
    return np.asarray(rows[np.lexsort(rows.T)])
