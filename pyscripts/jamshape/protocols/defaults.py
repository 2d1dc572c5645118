"""How packings are usually made: what a recipe has where nothing else was asked for."""

from __future__ import annotations

from typing import Any, NamedTuple

from jamshape.checks import RANGES, require_one_of, require_stated
from jamshape.minima.target import Target
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.recipe import Dynamics, Recipe, Steps, Thermalisation
from jamshape.shapes.particles import Particles

# A minimum that is led to an energy is at least so good.
_TIGHT = 1e-8


class Setting(NamedTuple):
    """A number of a recipe with its defaults: of the way by dynamics (2D), and by steps (3D); None: not of it."""

    name: str
    kind: type
    dynamics: float | None
    steps: float | None
    meaning: str

    def usual(self, way: str, dimension: int) -> Any:
        """Give the default."""
        if dimension == 2:
            return _IN_PLANE.get(self.name, getattr(self, way))
        return getattr(self, way)


SETTINGS = (
    Setting("n", int, 256, 400, "particles"),
    Setting("phi_start", float, 0.4, 0.1, "packing fraction of the random start"),
    Setting(
        "tolerance", float, 1e-8, 1e-4, "largest net force and torque over the mean bond force"
    ),
    Setting("u0", float, 1e-15, 0.0, "energy density U/L^D; 0: the first jammed packing as it is"),
    Setting("accuracy", float, 1e-7, 1e-7, "of |u - u0|/u0"),
    Setting("kappa", float, 4e-7, None, "slowest compression rate"),
    Setting("p_end", float, 1e-3, None, "pressure to compress to at that rate"),
    Setting("protocol", int, None, 1, "2: with Monte Carlo of hard particles at phi_thermal"),
    Setting("phi_thermal", float, None, 0.55, "packing fraction of the Monte Carlo"),
    Setting("n_sweeps", int, None, 100_000, "sweeps of it"),
    Setting("delta_phi", float, None, 1e-3, "step of the packing fraction"),
)

# What is not sensible for steps in the plane: N, and starts so dilute.
_IN_PLANE = {"n": 256, "phi_start": 0.4}


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
    require_one_of("the way", way, ("dynamics", "steps"))
    get = _values(given, way, dimension)
    target = Target(get["u0"], get["accuracy"], get["tolerance"]) if get["u0"] else None
    if way == "dynamics":
        how: Dynamics | Steps = Dynamics(Approach(kappa=get["kappa"], p_end=get["p_end"]))
    else:
        if target:
            target = Target(get["u0"], get["accuracy"], min(get["tolerance"], _TIGHT))
        quasistatic = Quasistatic(step=get["delta_phi"], tolerance=get["tolerance"])
        how = Steps(quasistatic, _thermal(get))
    return Recipe(particles, get["n"], dimension, seed, get["phi_start"], how, target)


def _thermal(get: dict[str, Any]) -> Thermalisation | None:
    require_one_of("protocol", get["protocol"], (1, 2))
    thermal = Thermalisation(get["phi_thermal"], get["n_sweeps"])
    return thermal if get["protocol"] == 2 else None


def _values(given: dict[str, Any], way: str, dimension: int) -> dict[str, Any]:
    """Fill in what was not given."""
    known = {setting.name: setting for setting in SETTINGS}
    for name, value in given.items():
        if name not in known:
            msg = f"{name} is no setting of a recipe, expected one of {', '.join(known)}"
            raise ValueError(msg)
        if value is not None and getattr(known[name], way) is None:
            msg = f"{name} is no setting of the way by {way}, expected another way or setting"
            raise ValueError(msg)
    kept = {name: value for name, value in given.items() if value is not None}
    require_stated(**{name: value for name, value in kept.items() if name in RANGES})
    return {name: one.usual(way, dimension) for name, one in known.items()} | kept
