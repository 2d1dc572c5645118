"""Superellipsoids, as the battery tries them."""

from __future__ import annotations

from functools import partial

from battery.scenes import superellipsoids as scenes
from battery.scenes.superellipsoids import EXPONENTS, P, W
from battery.session import fix
from battery.shapes import shape as row

SCATTERED: row.Scenes = {
    "p 0.55 to 10 in one box": partial(scenes.scattered, EXPONENTS, (1.0,)),
    "w 0.1 to 10 in one box": partial(scenes.scattered, (1.0, 1.5), (0.1, 1.0, 10.0)),
    "2D, p 0.55 to 10, w to 10": partial(scenes.scattered, (0.55, 1.0, 10.0), (10.0, 1.0), 2),
    "overlaps of a third": partial(scenes.scattered, (0.75, 2.0), (1.0, 3.0), 3, 1 / 3),
    "own images, w 10": scenes.needles,
}

# For the pair style, and its tests.
CROWDS: row.Scenes = {
    **{f"p {p} {w}": partial(scenes.of_one_shape, p, axes) for p in P for w, axes in W.items()},
    "all shapes": partial(scenes.of_all_shapes, 3),
    "plane, all shapes": partial(scenes.of_all_shapes, 2),
    "cubes face to face": partial(scenes.in_a_row, 10.0, 0.5),
    "octahedra tip to tip": partial(scenes.in_a_row, 0.55, 0.01),
    "nearly concentric": scenes.nearly_concentric,
    "overlap of a third": partial(scenes.overlapping_by, 1 / 3),
    "own images": partial(scenes.tiny_box, 3, (10.0, 0.55)),
    "plane, own images": partial(scenes.tiny_box, 2, (10.0, 0.55)),
}

SHAPES_OF_ONE = [(D, p, w) for D in (2, 3) for p in (0.55, 1.0, 10.0) for w in (0.1, 1.0, 10.0)]

# Flat faces and sharp tips magnify rounding.
_FORCES = 1e-12


def _name(D: int, p: float, w: float) -> str:
    return f"{D}D, p {p:g}, w {w:g}"


SUPERELLIPSOIDS = row.Shape(
    name="superellipsoids",
    style_name="superellipsoid",
    units=row.RELATIVE,
    laws=(row.Law("", 2, is_of_oracle=False),),
    landscape=row.OnLandscape(
        scenes=SCATTERED,
        counted=("p 0.55 to 10 in one box", "w 0.1 to 10 in one box", "own images, w 10"),
        rounding=1e-12,
        bent=("w 0.1 to 10 in one box", "own images, w 10", "overlaps of a third"),
        bend=1e-6,
        same_place=("concentric bodies", scenes.needles),
    ),
    style=row.InPairStyle(
        scenes=CROWDS
        | {
            "p 0.55 to 10 in one box": scenes.of_all_exponents,
            "spheres": scenes.crowd_of_spheres,
        },
        without_newton=("own images", "plane, own images"),
        in_units={name: CROWDS[name] for name in ("all shapes", "plane, all shapes", "own images")},
        mixed=scenes.of_two_types,
        limits=row.Limits(force=_FORCES, mixed=_FORCES, units=_FORCES),
        stops={
            f"{D}D, coincident centres, p {p:g}": partial(scenes.coincident, p, D)
            for p in (0.55, 1.0, 10.0)
            for D in (2, 3)
        },
        sentence="coinciding centres, where no contact force exists",
    ),
    flow=row.InFlow(
        invariant={f"{D}D, ": row.Drive(partial(scenes.dense, D), 1e-3, 0.01, 100) for D in (2, 3)},
        changed={f"{D}D": row.Drive(partial(scenes.dense, D), 1e-2, 0.01) for D in (2, 3)},
        restarted={f"{D}D": row.Drive(partial(scenes.dense, D), 1e-3, 0.02, 100) for D in (2, 3)},
        touch=row.Touch(scenes.two_spheres, 1e-6, scenes.RATE_OF_TWO_SPHERES, 1.0, 3.0),
        lone=scenes.lone,
        extreme={
            name: CROWDS[name]
            for name in ("all shapes", "plane, all shapes", "own images", "overlap of a third")
        },
        extreme_drive=fix(1e-4, 0.01, options="integrator heun/adaptive tolerance 1e-3"),
        extreme_steps=2,
        limit=_FORCES,
        must_relax=True,
        heavy=("all shapes",),
    ),
    minimized={
        name: CROWDS[name] for name in ("plane, all shapes", "own images", "plane, own images")
    },
    two_ranks={
        "own images": row.Drive(CROWDS["own images"], 0.0, 0.0),
        "p 0.55 and 10, w 0.1 and 10": row.Drive(CROWDS["all shapes"], 0.0, 0.0),
        "in motion": row.Drive(partial(scenes.dense, 3), 1e-3, 0.01, 50),
    },
    solvers=row.InSolvers(
        minimised={
            name: SCATTERED[name] for name in ("p 0.55 to 10 in one box", "w 0.1 to 10 in one box")
        },
        to_the_end=(),
        jammed={"spheroids": scenes.jammed_spheroids},
        quick=("spheroids",),
        in_units=("spheroids",),
        # Semi-axes, rounded to doubles in another unit, change quartic modes by more than their bounds.
        modes_in_units=(),
        spectra=("spheroids",),
    ),
    compressed=row.Compressed(
        implicit={name: SCATTERED[name] for name in ("2D, p 0.55 to 10, w to 10",)},
        quasistatic={_name(*x): partial(scenes.loose, *x) for x in SHAPES_OF_ONE},
        quick=(_name(2, 1.0, 1.0),),
        hard={_name(*x): partial(scenes.hard, *x) for x in SHAPES_OF_ONE},
        heavy_sweeps=tuple(_name(*x) for x in SHAPES_OF_ONE if x[0] == 3 and x[2] != 1),
    ),
)
