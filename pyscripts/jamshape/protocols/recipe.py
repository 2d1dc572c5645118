"""What a packing is made of, and how."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import require_one_of, require_rising, require_stated
from jamshape.files.h5md import read_packing
from jamshape.files.vocabulary import ATHERMAL, COMPRESSED, THERMAL
from jamshape.minima.target import Target, direct, halving
from jamshape.packing import Packing
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.random_start import dilute_packing, random_packing
from jamshape.shapes.particles import Particles
from jamshape.shapes.shape import Interaction

SEARCHES = {"direct": direct, "halving": halving}
"""Ways to lead a jammed state to an energy: ours, and that of Marschall & Teitel 2018, Sec. III C, as written."""

# Paper's slowest rate; a slower one in LAMMPS does not end in a time that anybody waits for.
_SLOWEST = 1e-10


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

    @property
    def search(self) -> str:
        """How the energy is looked for from there, one of `SEARCHES`."""

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start."""

    def attributes(self, target: Target | None) -> dict[str, Any]:
        """Return what identifies it, to be stored."""

    def require(self, recipe: Recipe) -> None:
        """Refuse a recipe that this way cannot follow; raises ValueError."""


@dataclass(frozen=True)
class Steps:
    """Quasistatic steps from the random start to the first jammed packing (Yuan et al. 2019, Sec. 2.2).

    These are the protocols yuan-2019-1 and, with Monte Carlo, yuan-2019-2.

    Parameters
    ----------
    quasistatic
        How to compress.
    thermal
        Monte Carlo before the last part of it; None for protocol 1.
    """

    search: ClassVar[str] = "direct"

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
        found: dict[str, Any] = {"protocol": THERMAL if self.thermal else ATHERMAL}
        if self.thermal:
            found |= {"phi_thermal": self.thermal.phi, "n_sweeps": self.thermal.n_sweeps}
        return found | self.steps(target)

    def steps(self, target: Target | None) -> dict[str, Any]:
        """Return what identifies its compression."""
        settings = vars(self.compression(target))
        return {f"quasistatic_{k}": v for k, v in settings.items() if v is not None}

    def require(self, recipe: Recipe) -> None:
        """Refuse a start that is denser than the Monte Carlo."""
        if self.thermal and not recipe.phi_start < self.thermal.phi:
            found = (
                f"phi_start is {recipe.phi_start} and the Monte Carlo runs at {self.thermal.phi}"
            )
            msg = f"{found}, expected a start at a smaller packing fraction"
            raise ValueError(msg)


@dataclass(frozen=True)
class Adaptive(Steps):
    """Quasistatic steps that are large where the packing is far from jamming: the fastest way there.

    Parameters
    ----------
    quasistatic
        How to compress; its `coarse` says how far steps may grow.
    """

    def attributes(self, target: Target | None) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        return {"way": "quasistatic"} | self.steps(target)


@dataclass(frozen=True)
class Dynamics:
    """Slow compression in LAMMPS until the state is jammed (Marschall & Teitel 2018, Sec. III B).

    Parameters
    ----------
    approach
        How to compress.
    """

    search: ClassVar[str] = "direct"

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
class Compressed:
    """Compression at one rate through jamming: the protocol marschall-2018 (Sec. II and III B-C, App. A).

    The energy is looked for from the first state of it that stays jammed when it is minimised; nothing opens the
    box before.

    Parameters
    ----------
    kappa
        Rate, dL/dt = -kappa L (Eq. 6), [1/time]; the paper's are 1e-6 to 1e-10.
    phi_end
        Packing fraction where the compression ends, well above jamming.
    search
        One of `SEARCHES`.
    source
        File with the frames of such a compression, which takes its place.

    Raises
    ------
    ValueError
        If a number is out of its range, the rate below the paper's slowest, or there is no such search.
    """

    kappa: float = 1e-6
    phi_end: float = 0.95
    search: str = "direct"
    source: Path | None = None

    def __post_init__(self) -> None:
        require_one_of("search", self.search, SEARCHES)
        if self.source is not None:
            return
        require_stated(kappa=self.kappa, phi_end=self.phi_end)
        if self.kappa < _SLOWEST:
            msg = (
                f"kappa is {self.kappa:g}, expected at least {_SLOWEST:g} in LAMMPS, the paper's slowest;"
                " compress with jamshape slow and take its file as the start"
            )
            raise ValueError(msg)

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start, without overlaps, or take the first frame of the file."""
        if self.source is not None:
            return read_packing(self.source, 0).with_(law=Interaction())
        return random_packing(
            recipe.n, recipe.phi_start, recipe.seed, recipe.particles, recipe.dimension
        )

    def attributes(self, target: Target | None) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        del target
        start = "" if self.source is None else self.source.name
        told = {"kappa": self.kappa, "phi_end": self.phi_end, "start": start}
        return {"protocol": COMPRESSED, "search": self.search} | told

    def require(self, recipe: Recipe) -> None:
        """Refuse a recipe without an energy, or that does not compress."""
        if recipe.target is None:
            msg = "there is no energy to reach, expected one after a compression at a rate (u0)"
            raise ValueError(msg)
        if self.source is None:
            require_rising(recipe.phi_start, self.phi_end)


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
    strict
        Whether to lead it on, at that energy, to a minimum without negative eigenvalues (`protocols.strict`).

    Raises
    ------
    ValueError
        If a number is out of its range, or a strict packing has no energy.

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
    strict: bool = False

    def __post_init__(self) -> None:
        require_stated(n=self.n, seed=self.seed, phi_start=self.phi_start)
        require_one_of("dimension", self.dimension, (2, 3))
        if self.strict and self.target is None:
            msg = "there is no energy to reach, expected one for a strict minimum (u0)"
            raise ValueError(msg)
        self.way.require(self)

    def start(self) -> Packing:
        """Make the random start; errors as in `random_start.random_packing`."""
        return self.way.start(self)

    @property
    def is_searched(self) -> bool:
        """Whether the energy is looked for by our own search, not by one as published."""
        return self.target is not None and self.way.search == "direct"

    def attributes(self) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        strict = {"strict": True} if self.strict else {}
        return self.before_target() | (vars(self.target) if self.target else {}) | strict

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
