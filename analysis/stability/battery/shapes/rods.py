"""Rods and discs, as the battery tries them."""

from __future__ import annotations

from functools import partial

from battery.oracle import of_rods
from battery.pairs import OVERLAPS
from battery.scenes import elongated as scenes
from battery.session import fix
from battery.shapes import shape as row

PLANE: row.Scenes = {
    "alpha 1e-6 to 100 in one box": partial(scenes.all_aspect_ratios, 2),
    "sizes 1 to 10": partial(scenes.all_sizes, 2),
    "longer than the box": scenes.longer_than_the_box,
    "own images": partial(scenes.own_images, 2),
    "overlaps of a third": partial(scenes.deep, 2),
}
SPACE: row.Scenes = {
    "3D, alpha 1e-6 to 10 in one box": partial(scenes.all_aspect_ratios, 3, 10.0),
    "3D, alpha 1e-6 to 100 in one box": partial(scenes.all_aspect_ratios, 3),
    "3D, sizes 1 to 10": partial(scenes.all_sizes, 3),
    "3D, own images": partial(scenes.own_images, 3),
    "3D, overlaps of a third": partial(scenes.deep, 3),
}


def stacks(*angles: float) -> row.Scenes:
    """Nearly parallel ones, in the plane."""
    return {f"stack to {a:g}": partial(scenes.stack, a, 2) for a in angles}


def stacks_in_space(*angles: float) -> row.Scenes:
    """Nearly parallel ones, in space."""
    return {f"3D, stack to {a:g}": partial(scenes.stack, a, 3) for a in angles}


# A stack at 1e-6 and below is within 1e-6 of kinks of the one-bond energy.
KINKED = stacks(1e-6, 1e-10, 1e-14) | stacks_in_space(1e-6, 1e-10, 1e-14)

PAIRS_OF_ALL_CLASSES: row.Scenes = {
    f"{dimension}D, overlap {overlap:.2g}": partial(scenes.overlaps, dimension, overlap)
    for dimension in (2, 3)
    for overlap in OVERLAPS
}

OF_ONE_ALPHA = [(D, alpha) for D in (2, 3) for alpha in (0.0, 0.01, 1.0, 10.0)]

JAMMED = partial(scenes.jammed, 1.0)

RODS = row.Shape(
    name="spherocylinders",
    style_name="spherocylinder",
    units=row.IN_OVERLAPS,
    laws=(
        row.Law(", sides one", 1, is_of_oracle=True),
        row.Law(", sides two", 2, is_of_oracle=False),
    ),
    oracle=of_rods,
    landscape=row.OnLandscape(
        scenes=PLANE | SPACE,
        kinked=KINKED,
        rounding=1e-13,
        bent=("alpha 1e-6 to 100 in one box", "sizes 1 to 10", "overlaps of a third"),
        bend=1e-9,
        same_place=("coincident rods", partial(scenes.own_images, 2)),
    ),
    style=row.InPairStyle(
        scenes=PLANE | SPACE | KINKED | PAIRS_OF_ALL_CLASSES,
        without_newton=("longer than the box", "own images", "3D, own images"),
        in_units={
            "alpha 1e-6 to 100 in one box": PLANE["alpha 1e-6 to 100 in one box"],
            "jammed": JAMMED,
        },
        mixed=partial(scenes.of_two_types, 1.0),
        limits=row.Limits(force=2e-14, mixed=1e-14, units=1e-13),
        stops={
            "crossing spines": scenes.crossed,
            "spines crossing by 1e-12": partial(scenes.crossed_by, 1e-12),
            "coincident centres": partial(scenes.two, [[1.0, 1.0], [1.0, 1.0]], 0.3),
            "crossing through the boundary": partial(
                scenes.two, [[5.9, 0.0], [-5.9, 0.2]], [0.0, 1.5]
            ),
            "collinear and overlapping": partial(scenes.two, [[1.0, 1.0], [1.5, 1.0]], 0.0),
            "coincident discs": partial(scenes.two, [[1.0, 1.0], [1.0, 1.0]], 0.0, 0.0),
        },
        sentence="crossing spines or coinciding centres, where no contact force exists",
    ),
    flow=row.InFlow(
        invariant={"": row.Drive(JAMMED, 1e-4, 0.05, 200)},
        changed={
            "jammed": row.Drive(JAMMED, 1e-3, 0.02),
            "alpha 1e-6 to 100": row.Drive(PLANE["alpha 1e-6 to 100 in one box"], 1e-3, 0.02),
        },
        restarted={"jammed": row.Drive(JAMMED, 1e-3, 0.02, 100)},
        touch=row.Touch(scenes.two_discs, 0.1, scenes.RATE_OF_TWO_DISCS, 1.0, 0.0),
        lone=scenes.lone,
        extreme={
            **{name: scene for name, scene in PLANE.items() if name != "sizes 1 to 10"},
            **{name: SPACE[name] for name in ("3D, own images", "3D, overlaps of a third")},
            **stacks(1e-6, 1e-9, 1e-14),
            **stacks_in_space(1e-6, 1e-14),
        },
        extreme_drive=fix(1e-4, 0.02),
        extreme_steps=100,
        limit=2e-13,
    ),
    minimized={
        **{name: PLANE[name] for name in ("alpha 1e-6 to 100 in one box", "own images")},
        "3D, own images": SPACE["3D, own images"],
        "overlaps of a third": PLANE["overlaps of a third"],
        **stacks(1e-12),
    },
    two_ranks={
        "alpha 1e-6 to 100": row.Drive(PLANE["alpha 1e-6 to 100 in one box"], 0.0, 0.0),
        "own images": row.Drive(SPACE["3D, own images"], 0.0, 0.0),
        "jammed, in motion": row.Drive(JAMMED, 1e-3, 0.01, 200),
    },
    solvers=row.InSolvers(
        minimised={
            **{name: scene for name, scene in PLANE.items() if name != "longer than the box"},
            "3D, overlaps of a third": SPACE["3D, overlaps of a third"],
            **stacks(1e-6, 1e-14),
        },
        to_the_end=("overlaps of a third", "own images", "3D, overlaps of a third"),
        jammed={
            "discs": partial(scenes.jammed, 0.0, 16, 0.77),
            "rods of alpha 0.01": partial(scenes.jammed, 0.01, 16, 0.77),
            "rods of alpha 1": partial(scenes.jammed, 1.0, 16, 0.86),
            "rods of alpha 4": partial(scenes.jammed, 4.0, 16, 0.8),
        },
        quick=("rods of alpha 1",),
        in_units=("discs", "rods of alpha 1"),
        modes_in_units=("discs", "rods of alpha 1"),
        spectra=("discs", "rods of alpha 0.01", "rods of alpha 4"),
    ),
    compressed=row.Compressed(
        implicit={
            **{name: PLANE[name] for name in ("alpha 1e-6 to 100 in one box", "own images")},
            "overlaps of a third": PLANE["overlaps of a third"],
            **stacks(1e-6, 1e-14),
        },
        quasistatic={f"{D}D, alpha {a:g}": partial(scenes.loose, D, a) for D, a in OF_ONE_ALPHA},
        quick=("2D, alpha 0", "2D, alpha 1", "3D, alpha 0"),
        hard={f"{D}D, alpha {a:g}": partial(scenes.hard, D, a) for D, a in OF_ONE_ALPHA},
    ),
)
