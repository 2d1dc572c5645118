"""Options that say how to make a packing."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any, NamedTuple

from jamshape.minima.target import Target
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.recipe import Dynamics, Recipe, Steps, Thermalisation
from jamshape.shapes.command_line import add_particle_options, particles_of

# A minimum that is led to an energy is at least so good.
_TIGHT = 1e-8


class _Option(NamedTuple):
    """An option with its defaults: of the way by dynamics (2D), and by steps (3D); None: not of it."""

    name: str
    kind: type
    dynamics: float | None
    steps: float | None
    meaning: str


_OPTIONS = (
    _Option("n", int, 256, 400, "particles"),
    _Option("phi-start", float, 0.4, 0.1, "packing fraction of the random start"),
    _Option(
        "tolerance", float, 1e-8, 1e-4, "largest net force and torque over the mean bond force"
    ),
    _Option("u0", float, 1e-15, 0.0, "energy density U/L^D; 0: the first jammed packing as it is"),
    _Option("accuracy", float, 1e-7, 1e-7, "of |u - u0|/u0"),
    _Option("kappa", float, 4e-7, None, "slowest compression rate"),
    _Option("p-end", float, 1e-3, None, "pressure to compress to at that rate"),
    _Option("protocol", int, None, 1, "2: with Monte Carlo of hard particles at phi-thermal"),
    _Option("phi-thermal", float, None, 0.55, "packing fraction of the Monte Carlo"),
    _Option("n-sweeps", int, None, 100_000, "sweeps of it"),
    _Option("delta-phi", float, None, 1e-3, "step of the packing fraction"),
)

# What is not sensible for steps in the plane: N, and starts so dilute.
_IN_PLANE = {"n": 256, "phi-start": 0.4}


def add_recipe_options(parser: ArgumentParser) -> None:
    """Add all options of a recipe."""
    add_particle_options(parser)
    group = parser.add_argument_group("how to make it")
    group.add_argument("--dimension", type=int, choices=(2, 3), help="(that of the shape's paper)")
    group.add_argument(
        "--way", choices=("dynamics", "steps"),
        help="to jamming: slow compression in LAMMPS (2D), or quasistatic steps (3D, or --protocol)",
    )  # fmt: skip
    group.add_argument("--seed", type=int, default=1, help="of all that is random (1)")
    for option in _OPTIONS:
        usual = {"dynamics": option.dynamics, "steps": option.steps}
        text = ", ".join(f"{way} {value:g}" for way, value in usual.items() if value is not None)
        group.add_argument(f"--{option.name}", type=option.kind, help=f"{option.meaning} ({text})")


def recipe_of(options: Namespace) -> Recipe:
    """Read a recipe from the options.

    Raises
    ------
    ValueError
        If an option is none of the shape or the way, or out of its range.
    """
    particles = particles_of(options)
    dimension = options.dimension or particles.shape.dimension
    by_steps = options.way == "steps" or (
        options.way is None and (dimension == 3 or options.protocol)
    )
    get = _values(options, "steps" if by_steps else "dynamics", dimension)
    target = Target(get["u0"], get["accuracy"], get["tolerance"]) if get["u0"] else None
    if by_steps:
        if target:
            target = Target(get["u0"], get["accuracy"], min(get["tolerance"], _TIGHT))
        way: Dynamics | Steps = Steps(
            Quasistatic(step=get["delta-phi"], tolerance=get["tolerance"]), _thermal(get)
        )
    else:
        way = Dynamics(Approach(kappa=get["kappa"], p_end=get["p-end"]))
    return Recipe(particles, get["n"], dimension, options.seed, get["phi-start"], way, target)


def _thermal(get: dict[str, Any]) -> Thermalisation | None:
    if get["protocol"] not in {1, 2}:
        msg = f"protocol is {get['protocol']}, expected 1 or 2"
        raise ValueError(msg)
    thermal = Thermalisation(get["phi-thermal"], get["n-sweeps"])
    return thermal if get["protocol"] == 2 else None


def _values(options: Namespace, way: str, dimension: int) -> dict[str, Any]:
    """Fill in what was not given."""
    found = {}
    for option in _OPTIONS:
        given = getattr(options, option.name.replace("-", "_"))
        usual = getattr(option, way)
        if given is not None and usual is None:
            msg = f"--{option.name} is no option of the way by {way}, expected --way or another option"
            raise ValueError(msg)
        if dimension == 2:
            usual = _IN_PLANE.get(option.name, usual)
        found[option.name] = usual if given is None else given
    return found
