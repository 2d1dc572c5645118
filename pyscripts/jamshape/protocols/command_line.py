"""Options that say how to make a packing."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any

from jamshape.protocols.defaults import SETTINGS, WAYS, recipe_for
from jamshape.protocols.recipe import Recipe
from jamshape.shapes.command_line import add_particle_options, particles_of


def add_recipe_options(parser: ArgumentParser) -> None:
    """Add all options of a recipe."""
    add_particle_options(parser)
    group = parser.add_argument_group("how to make it")
    group.add_argument("--dimension", type=int, choices=(2, 3), help="(that of the shape's paper)")
    group.add_argument(
        "--way", choices=tuple(WAYS),
        help="to jamming: slow compression in LAMMPS (2D), or quasistatic steps (3D, or --protocol)",
    )  # fmt: skip
    group.add_argument("--seed", type=int, default=1, help="of all that is random (1)")
    for one in SETTINGS:
        usual = {way: table.usual.get(one.name) for way, table in WAYS.items()}
        text = ", ".join(f"{way} {value:g}" for way, value in usual.items() if value is not None)
        option = f"--{one.name.replace('_', '-')}"
        group.add_argument(option, type=one.kind, help=f"{one.meaning} ({text})")


def settings_of(options: Namespace) -> dict[str, Any]:
    """Read what was given of a recipe, but for its particles, by the names of `recipe_for`."""
    names = ("dimension", "way", "seed", *(one.name for one in SETTINGS))
    return {name: getattr(options, name) for name in names}


def recipe_of(options: Namespace) -> Recipe:
    """Read a recipe from the options.

    Raises
    ------
    ValueError
        If an option is none of the shape or the way, or out of its range.
    """
    return recipe_for(particles_of(options), **settings_of(options))
