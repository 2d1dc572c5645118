"""What a packing is made of, and how."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import require_one_of, require_stated
from jamshape.files.h5md import read_packing
from jamshape.minima.target import Target
from jamshape.packing import Packing
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.random_start import dilute_packing, random_packing
from jamshape.shapes.particles import Particles


@dataclass(frozen=True)
class Thermalisation:
    """Monte Carlo of hard particles on the way: protocol 2 of Yuan et al. 2019, Sec. 2.2.

    Parameters
    ----------
    phi
        Packing fraction phi_i at which to run it.
    n_sweeps
        Their N_s.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """

    phi: float = 0.55
    n_sweeps: int = 100_000

    def __post_init__(self) -> None:
        require_stated(phi_thermal=self.phi, n_sweeps=self.n_sweeps)


class Way(Protocol):
    """From a random start to jamming."""

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start."""

    def attributes(self, target: Target | None) -> dict[str, Any]:
        """Return what identifies it, to be stored."""

    def require(self, recipe: Recipe) -> None:
        """Refuse a recipe that this way cannot follow; raises ValueError."""


@dataclass(frozen=True)
class Steps:
    """Quasistatic steps from the random start to the first jammed packing (Yuan et al. 2019, Sec. 2.2).

    Parameters
    ----------
    quasistatic
        How to compress.
    thermal
        Monte Carlo before the last part of it; None for protocol 1.
    """

    quasistatic: Quasistatic = field(default_factory=Quasistatic)
    thermal: Thermalisation | None = None

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start, which in space may have overlaps: the first minimisation undoes them."""
        make = random_packing if recipe.dimension == 2 else dilute_packing
        return make(recipe.n, recipe.phi_start, recipe.seed, recipe.particles, recipe.dimension)

    def compression(self, target: Target | None) -> Quasistatic:
        """How to compress: what is to be led elsewhere need not be close to the tolerance."""
        return replace(self.quasistatic, closeness=math.inf) if target else self.quasistatic

    def attributes(self, target: Target | None) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        found: dict[str, Any] = {"protocol": 2 if self.thermal else 1}
        if self.thermal:
            found |= {"phi_thermal": self.thermal.phi, "n_sweeps": self.thermal.n_sweeps}
        return found | {f"quasistatic_{k}": v for k, v in vars(self.compression(target)).items()}

    def require(self, recipe: Recipe) -> None:
        """Refuse a start that is denser than the Monte Carlo."""
        if self.thermal and not recipe.phi_start < self.thermal.phi:
            found = (
                f"phi_start is {recipe.phi_start} and the Monte Carlo runs at {self.thermal.phi}"
            )
            msg = f"{found}, expected a start at a smaller packing fraction"
            raise ValueError(msg)


@dataclass(frozen=True)
class Dynamics:
    """Slow compression in LAMMPS until the state is jammed (Marschall & Teitel 2018, Sec. III B).

    Parameters
    ----------
    approach
        How to compress.
    """

    approach: Approach = field(default_factory=Approach)

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start, without overlaps."""
        return random_packing(
            recipe.n, recipe.phi_start, recipe.seed, recipe.particles, recipe.dimension
        )

    def attributes(self, target: Target | None) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        del target
        found = {f"approach_{k}": v for k, v in vars(self.approach).items()}
        return found | {"kappa": self.approach.kappa}

    def require(self, recipe: Recipe) -> None:
        """Refuse a recipe without an energy."""
        if recipe.target is None:
            msg = "there is no energy to reach, expected one after a compression by dynamics (u0)"
            raise ValueError(msg)


@dataclass(frozen=True)
class Recipe:
    """What a packing is made of, and how.

    Parameters
    ----------
    particles
        Shapes and sizes.
    n, dimension, seed
        Number of particles, 2 or 3, and the seed of all that is random.
    phi_start
        Packing fraction of the random start.
    way
        From there to jamming.
    target
        Energy density to lead the packing to; None for the first jammed packing of `Steps` as it is.

    Raises
    ------
    ValueError
        If a number is out of its range.

    Examples
    --------
    >>> from jamshape.protocols.recipe import Recipe
    >>> from jamshape.shapes.particles import Particles
    >>> recipe = Recipe(Particles.of(alpha=1.0), n=16, phi_start=0.3)
    >>> recipe.start().n
    16
    """

    particles: Particles = field(default_factory=Particles.of)
    n: int = 256
    dimension: int = 2
    seed: int = 1
    phi_start: float = 0.4
    way: Way = field(default_factory=Dynamics)
    target: Target | None = field(default_factory=Target)

    def __post_init__(self) -> None:
        require_stated(n=self.n, seed=self.seed, phi_start=self.phi_start)
        require_one_of("dimension", self.dimension, (2, 3))
        self.way.require(self)

    def start(self) -> Packing:
        """Make the random start; errors as `random_start.random_packing`."""
        return self.way.start(self)

    def attributes(self) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        return self.before_target() | (vars(self.target) if self.target else {})

    def before_target(self) -> dict[str, Any]:
        """Return what identifies it as far as it is before the energy is led to its target."""
        numbers = {"n": self.n, "seed": self.seed, "phi_start": self.phi_start}
        return dict(self.particles.told) | numbers | self.way.attributes(self.target)

    def require_particles(self, path: Path) -> None:
        """Refuse a file that is damaged or holds other particles than these.

        Raises
        ------
        ValueError
        """
        packing, shape = read_packing(path), self.particles.shape.name
        found = f"{path} holds {packing.n} particles of shape {packing.shape_style!r}"
        if (packing.n, packing.dimension, packing.shape_style) != (self.n, self.dimension, shape):
            msg = (
                f"{found} in {packing.dimension} dimensions, expected {self.n} of {shape!r} in"
                f" {self.dimension}; write to another file"
            )
            raise ValueError(msg)
        sizes = self.particles.sample(self.n, np.random.default_rng(self.seed))
        if not np.array_equal(_sorted(packing.diameters), _sorted(sizes.diameters)):
            msg = f"{found}, expected those of another mixture; write to another file"
            raise ValueError(msg)


def _sorted(rows: FloatArray) -> FloatArray:
    return np.asarray(rows[np.lexsort(rows.T)])
