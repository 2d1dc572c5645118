"""Recipes: particles of a packing, and its preparation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.checks import ArgumentError, require_one_of, require_rising, require_stated
from jamshape.files.h5md import read_packing
from jamshape.files.vocabulary import ATHERMAL, COMPRESSED, MINIMISED, THERMAL
from jamshape.minima.boxes import FREE, Yielding
from jamshape.minima.target import FixedBox, Target, bisection, extrapolation
from jamshape.packing import Packing
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.random_start import compression_start, dilute_packing
from jamshape.shapes.particles import Particles

SEARCHES = {"extrapolation": extrapolation, "bisection": bisection}
"""Searches for a target energy: ours, and that of Marschall & Teitel 2018, Sec. III C, as written."""

Aim = Target | Yielding
"""Target energy, or another target with a box that yields."""

# The paper's slowest rate; slower ones would not end in LAMMPS in reasonable time.
_SLOWEST = 1e-10


@dataclass(frozen=True)
class Thermalisation:
    """Monte Carlo of hard particles before jamming: protocol 2 of Yuan et al. 2019, Sec. 2.2.

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
    """A way from a random start to jamming."""

    @property
    def search(self) -> str:
        """Search for the energy from there, one of `SEARCHES`."""

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start."""

    def attributes(self, target: Aim | None) -> dict[str, Any]:
        """Return its identifying attributes."""

    def require(self, recipe: Recipe) -> None:
        """Refuse a recipe that this way cannot follow; raises ValueError."""


@dataclass(frozen=True)
class Steps:
    """Quasistatic steps from the random start to the first jammed packing (Yuan et al. 2019, Sec. 2.2).

    These are the protocols yuan-2019-1 and, with Monte Carlo, yuan-2019-2.

    Parameters
    ----------
    quasistatic
        Settings of the compression.
    thermal
        Monte Carlo before its last part; None for protocol 1.
    """

    search: ClassVar[str] = "extrapolation"

    quasistatic: Quasistatic = field(default_factory=Quasistatic)
    thermal: Thermalisation | None = None

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start, which in space may have overlaps: the first minimisation removes them."""
        make = compression_start if recipe.dimension == 2 else dilute_packing
        return make(recipe.n, recipe.phi_start, recipe.seed, recipe.particles, recipe.dimension)

    def compression(self, target: Aim | None) -> Quasistatic:
        """Return the settings of the compression; before a target energy it need not be close to the tolerance."""
        return replace(self.quasistatic, closeness=math.inf) if target else self.quasistatic

    def attributes(self, target: Aim | None) -> dict[str, Any]:
        """Return its identifying attributes."""
        found: dict[str, Any] = {"protocol": THERMAL if self.thermal else ATHERMAL}
        if self.thermal:
            found |= {"phi_thermal": self.thermal.phi, "n_sweeps": self.thermal.n_sweeps}
        return found | self.steps(target)

    def steps(self, target: Aim | None) -> dict[str, Any]:
        """Return the identifying attributes of its compression."""
        settings = vars(self.compression(target))
        return {f"quasistatic_{k}": v for k, v in settings.items() if v is not None}

    def require(self, recipe: Recipe) -> None:
        """Refuse a start denser than the Monte Carlo."""
        if self.thermal and not recipe.phi_start < self.thermal.phi:
            found = (
                f"phi_start is {recipe.phi_start} and the Monte Carlo runs at {self.thermal.phi}"
            )
            msg = f"{found}, expected a start at a smaller packing fraction"
            raise ValueError(msg)


@dataclass(frozen=True)
class Adaptive(Steps):
    """Quasistatic steps that are large far from jamming: the fastest way there.

    Parameters
    ----------
    quasistatic
        Settings of the compression; its `coarse` limits the growth of steps.
    """

    def attributes(self, target: Aim | None) -> dict[str, Any]:
        """Return its identifying attributes."""
        return {"protocol": "quasistatic"} | self.steps(target)


@dataclass(frozen=True)
class Dynamics:
    """Slow compression in LAMMPS until the state is jammed (Marschall & Teitel 2018, Sec. III B).

    Parameters
    ----------
    approach
        Settings of the compression.
    """

    search: ClassVar[str] = "extrapolation"

    approach: Approach = field(default_factory=Approach)

    def start(self, recipe: Recipe) -> Packing:
        """Make the random start, without overlaps."""
        return compression_start(
            recipe.n, recipe.phi_start, recipe.seed, recipe.particles, recipe.dimension
        )

    def attributes(self, target: Aim | None) -> dict[str, Any]:
        """Return its identifying attributes."""
        del target
        found = {f"approach_{k}": v for k, v in vars(self.approach).items()}
        return found | {"kappa": self.approach.kappa}

    def require(self, recipe: Recipe) -> None:
        """Refuse a recipe without a target energy."""
        if recipe.target is None:
            said = "{u0} does not work with the protocol dynamics, expected a positive one"
            raise ArgumentError(said, {"u0": 0})


@dataclass(frozen=True)
class Compressed:
    """Compression at one rate through jamming: the protocol marschall-2018 (Sec. II and III B-C, App. A).

    The search for the energy starts from its first state that stays jammed when minimised; the box is not opened
    before.

    Parameters
    ----------
    kappa
        Rate, dL/dt = -kappa L (Eq. 6), [1/time]; the paper's are 1e-6 to 1e-10.
    phi_end
        Final packing fraction, well above jamming.
    search
        One of `SEARCHES`.
    source
        File with the frames of such a compression, used instead.

    Raises
    ------
    ValueError
        If a number is out of its range, the rate is below the paper's slowest, or the search is unknown.
    """

    kappa: float = 1e-6
    phi_end: float = 0.95
    search: str = "extrapolation"
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
            first = read_packing(self.source, 0)
            return first.with_(law=first.law.but(sides=2))
        return compression_start(
            recipe.n, recipe.phi_start, recipe.seed, recipe.particles, recipe.dimension
        )

    def attributes(self, target: Aim | None) -> dict[str, Any]:
        """Return its identifying attributes."""
        del target
        start = "" if self.source is None else self.source.name
        told = {"kappa": self.kappa, "phi_end": self.phi_end, "start": start}
        return {"protocol": COMPRESSED, "search": self.search} | told

    def require(self, recipe: Recipe) -> None:
        """Refuse a recipe without a target energy, or that does not compress."""
        if recipe.target is None:
            said = "{u0} does not work with the protocol marschall-2018, expected a positive one"
            raise ArgumentError(said, {"u0": 0})
        if self.source is None:
            require_rising(recipe.phi_start, self.phi_end)


@dataclass(frozen=True)
class Given:
    """No way at all: a state of one's own, to be minimised at its box or led to a target.

    Parameters
    ----------
    packing
        The state.
    made_from
        Attributes that describe it.
    goal
        Fixed box with its minimiser, or a target.
    evaluations
        Largest number of evaluations of all forces at a fixed box.
    """

    packing: Packing
    made_from: Mapping[str, Any]
    goal: FixedBox | Aim
    evaluations: int = 200_000
    search: ClassVar[str] = "extrapolation"

    def start(self, recipe: Recipe) -> Packing:
        """Return the state."""
        del recipe
        return self.packing

    def attributes(self, target: Aim | None) -> dict[str, Any]:
        """Return its identifying attributes."""
        del target
        told = {"protocol": MINIMISED, "evaluations_limit": self.evaluations}
        return dict(self.made_from) | self.goal.settings | told

    def require(self, recipe: Recipe) -> None:
        """Refuse nothing."""


@dataclass(frozen=True)
class Recipe:
    """Ingredients and protocol of a packing.

    Parameters
    ----------
    particles
        Shapes and sizes.
    n, dimension, seed
        Number of particles, 2 or 3, and the random seed.
    phi_start
        Packing fraction of the random start.
    way
        Way from there to jamming.
    target
        Target energy density, or another target with a box that yields; None for the first jammed packing of `Steps`
        as it is.
    strict
        Whether to continue, at that energy, to a minimum without negative eigenvalues (`protocols.strict`).
    stable_to_shear
        Whether to continue, in a free box, until no motion of particles and box lowers the enthalpy.

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
    target: Aim | None = field(default_factory=Target)
    strict: bool = False
    stable_to_shear: bool = False

    def __post_init__(self) -> None:
        require_stated(n=self.n, seed=self.seed, phi_start=self.phi_start)
        require_one_of("dimension", self.dimension, (2, 3))
        if self.strict and self.goal is None:
            said = "{u0} does not work with a strict minimum, expected a positive one"
            raise ArgumentError(said, {"u0": 0})
        if isinstance(self.goal, Yielding):
            self._require_yielding(self.goal)
        elif self.stable_to_shear:
            said = "{stable_to_shear} needs a free box, expected {box:name} free, or none of both"
            raise ArgumentError(said, {"stable_to_shear": True, "box": None})
        self.way.require(self)

    def _require_yielding(self, goal: Yielding) -> None:
        """Refuse what has no effect beside a box that yields."""
        if self.strict:
            said = "{strict} works at a given energy or box, found {box}; leave one of them out"
            raise ArgumentError(said, {"strict": True, "box": goal.box})
        if self.way.search != "extrapolation":
            said = (
                "{search} finds an energy in an isotropic box, found {box}; leave one of them out"
            )
            raise ArgumentError(said, {"search": self.way.search, "box": goal.box})
        if self.stable_to_shear and goal.box != FREE:
            said = "{stable_to_shear} needs a box that is free, found {box}; leave one of them out"
            raise ArgumentError(said, {"stable_to_shear": True, "box": goal.box})

    def start(self) -> Packing:
        """Make the random start; errors as in `random_start.random_packing`."""
        return self.way.start(self)

    @property
    def goal(self) -> FixedBox | Aim | None:
        """Target, or fixed box; None for the first jammed packing."""
        return self.way.goal if isinstance(self.way, Given) else self.target

    def attributes(self) -> dict[str, Any]:
        """Return its identifying attributes."""
        strict = {"strict": True} if self.strict else {}
        strict |= {"stable_to_shear": True} if self.stable_to_shear else {}
        return self.before_target() | (self.target.settings if self.target else {}) | strict

    @property
    def identity(self) -> dict[str, Any]:
        """Return `attributes`, with None for what is not to be in a file of this recipe."""
        return {"law": None} | self.attributes()

    def before_target(self) -> dict[str, Any]:
        """Return the attributes that identify the stages before the energy search."""
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
