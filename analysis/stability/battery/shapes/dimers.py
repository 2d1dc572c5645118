"""Dimers, as the battery tries them."""

from __future__ import annotations

from functools import partial

from battery.oracle import of_dimers
from battery.pairs import OVERLAPS
from battery.scenes import elongated as scenes
from battery.scenes.elongated import DIMERS as STYLE
from battery.session import fix
from battery.shapes import shape as row
from jamshape.packing import Packing

PLANE: row.Scenes = {
    "alpha 1e-6 to 100 in one box": partial(scenes.all_aspect_ratios, 2, style=STYLE),
    "sizes 1 to 10": partial(scenes.all_sizes, 2, style=STYLE),
    "own images": partial(scenes.as_dimers, partial(scenes.own_images, 2)),
    "overlaps of a third": partial(scenes.deep, 2, style=STYLE),
}
SPACE: row.Scenes = {
    "3D, alpha 1e-6 to 10 in one box": partial(scenes.all_aspect_ratios, 3, 10.0, STYLE),
    "3D, own images": partial(scenes.as_dimers, partial(scenes.own_images, 3)),
    "3D, overlaps of a third": partial(scenes.deep, 3, style=STYLE),
}
INTERLOCKED: row.Scenes = {
    f"{dimension}D, one to four bonds, overlap {overlap:.2g}": partial(
        scenes.interlocked, dimension, overlap
    )
    for dimension in (2, 3)
    for overlap in OVERLAPS
}


def _pair(*positions: list[float], angle: float = 0.0) -> partial[Packing]:
    return partial(scenes.as_dimers, partial(scenes.two, list(positions), angle))


JAMMED = partial(scenes.jammed, 1.0, style=STYLE)
OF_ONE_ALPHA = [(D, alpha) for D in (2, 3) for alpha in (0.01, 1.0, 10.0)]


def _named(names: row.Scenes) -> row.Scenes:
    """Give scenes the name of the shape, among those of others."""
    return {f"dimers, {name}": scene for name, scene in names.items()}


DIMERS = row.Shape(
    name="dimers",
    style_name=STYLE,
    units=row.IN_OVERLAPS,
    laws=(row.Law("", 2, is_of_oracle=True),),
    oracle=of_dimers,
    landscape=row.OnLandscape(
        scenes=PLANE | SPACE,
        rounding=1e-13,
        bent=("alpha 1e-6 to 100 in one box", "sizes 1 to 10", "overlaps of a third"),
        bend=1e-9,
        same_place=("coincident dimers", _pair([1.0, 1.0], [5.0, 1.0], angle=0.3)),
    ),
    style=row.InPairStyle(
        scenes=PLANE | SPACE | INTERLOCKED,
        without_newton=("own images", "3D, own images"),
        in_units={"jammed": JAMMED},
        mixed=partial(scenes.of_two_types, 1.0, STYLE),
        limits=row.Limits(force=2e-14, mixed=1e-14, units=1e-13),
        stops={
            "coincident centres": _pair([1.0, 1.0], [1.0, 1.0], angle=0.3),
            "coincident discs": _pair([0.0, 0.0], [2.0, 0.0]),
        },
        sentence="coinciding discs, where no contact force exists",
    ),
    flow=row.InFlow(
        invariant={"": row.Drive(JAMMED, 1e-4, 0.05, 200)},
        changed={"jammed": row.Drive(JAMMED, 1e-3, 0.02)},
        restarted={"jammed": row.Drive(JAMMED, 1e-3, 0.02, 100)},
        touch=row.Touch(scenes.two_dimers, 0.1, scenes.RATE_OF_TWO_DIMERS, 2.0, 0.0),
        lone=partial(scenes.as_dimers, scenes.lone),
        extreme={
            "alpha 1e-6 to 100 in one box": PLANE["alpha 1e-6 to 100 in one box"],
            "own images": PLANE["own images"],
            "3D, own images": SPACE["3D, own images"],
            "overlaps of a third": PLANE["overlaps of a third"],
        },
        extreme_drive=fix(1e-4, 0.02),
        extreme_steps=100,
        limit=2e-13,
        few_stops=True,
    ),
    minimized={name: PLANE[name] for name in ("own images", "overlaps of a third")},
    two_ranks={
        "own images": row.Drive(SPACE["3D, own images"], 0.0, 0.0),
        "jammed, in motion": row.Drive(JAMMED, 1e-3, 0.01, 200),
    },
    solvers=row.InSolvers(
        minimised=_named(PLANE | {"3D, own images": SPACE["3D, own images"]}),
        to_the_end=("dimers, overlaps of a third",),
        jammed={"dimers of alpha 1": partial(scenes.jammed, 1.0, 16, 0.87, STYLE)},
        quick=("dimers of alpha 1",),
        in_units=("dimers of alpha 1",),
        modes_in_units=("dimers of alpha 1",),
        spectra=("dimers of alpha 1",),
    ),
    compressed=row.Compressed(
        implicit=_named(
            {name: PLANE[name] for name in ("alpha 1e-6 to 100 in one box", "own images")}
        ),
        quasistatic={
            f"dimers, {D}D, alpha {a:g}": partial(scenes.loose, D, a, style=STYLE)
            for D, a in OF_ONE_ALPHA
        },
        quick=("dimers, 2D, alpha 1",),
        hard={
            f"dimers, {D}D, alpha {a:g}": partial(scenes.hard, D, a, STYLE) for D, a in OF_ONE_ALPHA
        },
    ),
)
