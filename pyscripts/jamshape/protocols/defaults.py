"""How packings are usually made: what a recipe has where nothing else was asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from jamshape.checks import RANGES, require_one_of, require_stated
from jamshape.minima.target import Target
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.recipe import Dynamics, Recipe, Steps, Thermalisation, Way
from jamshape.shapes.particles import Particles

# A minimum that is led to an energy is at least so good.
_TIGHT = 1e-8

Values = Mapping[str, Any]
"""Numbers of a recipe by their names."""


class Setting(NamedTuple):
    """A number of a recipe that may be asked for; the ways that have it are those of `WAYS` with a default."""

    name: str
    kind: type
    meaning: str


SETTINGS = (
    Setting("n", int, "particles"),
    Setting("phi_start", float, "packing fraction of the random start"),
    Setting("tolerance", float, "largest net force and torque over the mean bond force"),
    Setting("u0", float, "energy density U/L^D; 0: the first jammed packing as it is"),
    Setting("accuracy", float, "of |u - u0|/u0"),
    Setting("kappa", float, "slowest compression rate"),
    Setting("p_end", float, "pressure to compress to at that rate"),
    Setting("protocol", int, "2: with Monte Carlo of hard particles at phi_thermal"),
    Setting("phi_thermal", float, "packing fraction of the Monte Carlo"),
    Setting("n_sweeps", int, "sweeps of it"),
    Setting("delta_phi", float, "step of the packing fraction"),
)


class UsualWay(NamedTuple):
    """A way to jamming by its name: how it is made of its settings, and their defaults.

    What has no default is no setting of the way, and is refused.
    """

    compose: Callable[[Values], tuple[Way, Target | None]]
    """From the values of all its settings."""
    usual: Values
    in_plane: Values = MappingProxyType({})
    """Defaults that are others in 2D."""

    def defaults(self, dimension: int) -> dict[str, Any]:
        """Give all its settings as they are where nothing was asked for."""
        return dict(self.usual) | (dict(self.in_plane) if dimension == 2 else {})


def _by_dynamics(get: Values) -> tuple[Way, Target | None]:
    way = Dynamics(Approach(kappa=get["kappa"], p_end=get["p_end"]))
    return way, _target(get, get["tolerance"])


def _by_steps(get: Values) -> tuple[Way, Target | None]:
    require_one_of("protocol", get["protocol"], (1, 2))
    thermal = Thermalisation(get["phi_thermal"], get["n_sweeps"])
    quasistatic = Quasistatic(step=get["delta_phi"], tolerance=get["tolerance"])
    way = Steps(quasistatic, thermal if get["protocol"] == 2 else None)
    return way, _target(get, min(get["tolerance"], _TIGHT))


def _target(get: Values, tolerance: float) -> Target | None:
    return Target(get["u0"], get["accuracy"], tolerance) if get["u0"] else None


WAYS: dict[str, UsualWay] = {
    "dynamics": UsualWay(
        _by_dynamics,
        {
            "n": 256, "phi_start": 0.4, "tolerance": 1e-8, "u0": 1e-15, "accuracy": 1e-7,
            "kappa": 4e-7, "p_end": 1e-3,
        },
    ),
    "steps": UsualWay(
        _by_steps,
        {
            "n": 400, "phi_start": 0.1, "tolerance": 1e-4, "u0": 0.0, "accuracy": 1e-7,
            "protocol": 1, "phi_thermal": 0.55, "n_sweeps": 100_000, "delta_phi": 1e-3,
        },
        {"n": 256, "phi_start": 0.4},
    ),
}  # fmt: skip
"""Slow compression in LAMMPS; quasistatic steps. Another way is one more entry."""


def recipe_for(
    particles: Particles,
    dimension: int | None = None,
    way: str | None = None,
    seed: int = 1,
    **given: Any,
) -> Recipe:
    """Make a recipe of what is given, and of what is usual for the rest.

    Parameters
    ----------
    particles : Particles
    dimension : {2, 3}, optional
        That of the shape's paper when left out.
    way : {"dynamics", "steps"}, optional
        Slow compression in LAMMPS, usual in 2D, or quasistatic steps, usual in 3D and where a protocol
        is given.
    seed : int
        Of all that is random.
    **given
        Numbers of `SETTINGS` by name; None where they are left out.

    Returns
    -------
    Recipe

    Raises
    ------
    ValueError
        If a number is none of the way, or out of its range.

    Examples
    --------
    >>> from jamshape.protocols.defaults import recipe_for
    >>> from jamshape.shapes.particles import Particles
    >>> recipe_for(Particles.of(alpha=4.0), n=64).target.u0
    1e-15
    """
    dimension = particles.shape.dimension if dimension is None else dimension
    require_one_of("dimension", dimension, (2, 3))
    way = way or ("steps" if dimension == 3 or given.get("protocol") else "dynamics")
    require_one_of("the way", way, WAYS)
    get = _values(given, way, dimension)
    how, target = WAYS[way].compose(get)
    return Recipe(particles, get["n"], dimension, seed, get["phi_start"], how, target)


def _values(given: dict[str, Any], way: str, dimension: int) -> dict[str, Any]:
    """Fill in what was not given."""
    usual, known = WAYS[way].defaults(dimension), [setting.name for setting in SETTINGS]
    for name, value in given.items():
        if name not in known:
            msg = f"{name} is no setting of a recipe, expected one of {', '.join(known)}"
            raise ValueError(msg)
        if value is not None and name not in usual:
            msg = f"{name} is no setting of the way by {way}, expected another way or setting"
            raise ValueError(msg)
    kept = {name: value for name, value in given.items() if value is not None}
    require_stated(**{name: value for name, value in kept.items() if name in RANGES})
    return usual | kept
