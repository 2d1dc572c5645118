"""Scenes that the extreme cases run on, and how forces are judged: a row for each shape."""

from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import extreme_rods as rod
import extreme_superellipsoids as ellipsoid
import numpy as np
from extreme_in_lammps import fix
from extreme_rods import DIMERS as DIMER
from extreme_rods import as_dimers
from extreme_superellipsoids import EXPONENTS, P, W
from long_oracle import of_dimers, of_rods
from pair_contacts import OVERLAPS

# --- rows ----------------------------------------------------------------------------------------


class Overlaps:
    """Units of rods with 2R of about 1: force times 2R / k_e, torques over the half length or the radius."""

    words = "in overlaps"

    @staticmethod
    def contacts(force, k_e):
        return np.full(len(force), k_e)

    @staticmethod
    def force(packing, _, k_e):
        return k_e / packing.diameters[:, 1].min()

    @staticmethod
    def torque(packing, _, force):
        return force * np.maximum(packing.half_length, packing.radius)[:, None]


class Relative:
    """Units of shapes whose overlaps and sizes are of any order."""

    words = "relative"

    @staticmethod
    def contacts(force, _):
        return np.abs(force).max(axis=1, initial=0.0)

    @staticmethod
    def force(_, force, __):
        return np.abs(force).max() or 1.0

    @staticmethod
    def torque(packing, torque, force):
        # Torques of spheres are rounding.
        return max(np.abs(torque).max(), 1e-3 * packing.diameters.min() * force)


class Law(NamedTuple):
    words: str
    sides: int
    is_of_oracle: bool


class Drive(NamedTuple):
    """A packing, and how the fix drives it."""

    scene: object
    kappa: float
    dt: float
    steps: int = 0


class Touch(NamedTuple):
    """Two particles of diameter 1 along x, whose overlap s relaxes as ds/dt = -rate s."""

    scene: object
    overlap: float
    rate: float  # in units of k_e / (k_d d^(D + 2))
    length: float  # distance of their centres when they touch
    second: float  # largest relative change of s by the next order of the law


@dataclass(frozen=True)
class Shape:
    """Scenes by the names that labels of cases have."""

    name: str
    style_name: str
    units: type
    laws: tuple
    oracle: object = None
    counted: tuple = ()  # scenes whose contacts are counted without an oracle

    # Sums over packings.
    summed: dict = None
    rounding: float = 1e-13  # doubles against long doubles, in overlaps
    bent: tuple = ()  # those of them whose Hessians are judged
    bend: float = 1e-9  # length of the differences of forces, for these
    same_place: tuple = ()  # name and scene whose first two particles are put at one place
    kinked: dict = field(
        default_factory=dict
    )  # so close to kinks that only an oracle judges forces

    # The pair style.
    in_style: dict = None
    without_newton: tuple = ()
    style_in_units: dict = None
    mixed: object = None  # a scene of two types that touch
    limits: tuple = ()  # of errors: of forces, with k_e of 1e-6 to 1e6 in one box, in other units
    stops: dict = None
    sentence: str = ""

    # The fix that moves particles.
    invariant: dict = None
    changed: dict = None  # at changing rates
    restarted: dict = None
    touch: Touch = None
    lone: object = None
    driven: dict = None
    drive: str = ""  # of these
    drive_steps: int = 100
    drive_limit: float = 0.0  # of errors of forces after a run
    must_relax: bool = False  # whether the energy must fall
    drive_heavy: tuple = ()
    few_stops: bool = False  # whether one time step beyond the limit is enough by default
    two_ranks: dict = None  # still ones have no steps

    # Minimisers, energy targets and spectra.
    minimised_by_lammps: dict = None
    minimised: dict = None
    to_the_end: tuple = ()  # those of them that are minimised to the end, and whose modes are judged there
    jammed: dict = None  # starts of energy targets
    quick_targets: tuple = ()  # those of them that reach u0 = 1e-15 in a few seconds
    targets_in_units: tuple = ()
    modes_in_units: tuple = ()
    spectra: tuple = ()  # those of them whose bounds of eigenvalues are counted

    # Compressions without LAMMPS.
    implicit: dict = None
    quasistatic: dict = None
    quick_to_jam: tuple = ()  # those of them that jam in a few seconds
    hard: dict = None  # without overlaps
    heavy_sweeps: tuple = ()


def is_long(name):
    """Whether a scene holds rods as long as its box: the rounding of their axes moves tips further."""
    return "100" in name or "longer" in name


def chosen(scenes, *names):
    return {name: scenes[name] for name in names}


# --- rods ----------------------------------------------------------------------------------------

ALL_ALPHA, THIRD = "alpha 1e-6 to 100 in one box", "overlaps of a third"

PLANE = {
    ALL_ALPHA: partial(rod.all_aspect_ratios, 2),
    "sizes 1 to 10": partial(rod.all_sizes, 2),
    "longer than the box": rod.longer_than_the_box,
    "own images": partial(rod.own_images, 2),
    THIRD: partial(rod.deep, 2),
}
SPACE = {
    "3D, alpha 1e-6 to 10 in one box": partial(rod.all_aspect_ratios, 3, 10.0),
    f"3D, {ALL_ALPHA}": partial(rod.all_aspect_ratios, 3),
    "3D, sizes 1 to 10": partial(rod.all_sizes, 3),
    "3D, own images": partial(rod.own_images, 3),
    f"3D, {THIRD}": partial(rod.deep, 3),
}


def stacks(*angles, dimension=2):
    where = "3D, " if dimension == 3 else ""
    return {f"{where}stack to {a:g}": partial(rod.stack, a, dimension) for a in angles}


# A stack at 1e-6 and below is within 1e-6 of kinks of the one-bond energy.
KINKED = stacks(1e-6, 1e-10, 1e-14) | stacks(1e-6, 1e-10, 1e-14, dimension=3)
OF_ONE_ALPHA = {f"{D}D, alpha {a:g}": (D, a) for D in (2, 3) for a in (0.0, 0.01, 1.0, 10.0)}
JAMMED = partial(rod.jammed, 1.0)
BENT = (ALL_ALPHA, "sizes 1 to 10", THIRD)
LIMITS = (2e-14, 1e-14, 1e-13)

RODS = Shape(
    name="spherocylinders",
    style_name="spherocylinder",
    units=Overlaps,
    laws=(Law(", sides one", 1, is_of_oracle=True), Law(", sides two", 2, is_of_oracle=False)),
    oracle=of_rods,
    summed=PLANE | SPACE,
    bent=BENT,
    same_place=("coincident rods", PLANE["own images"]),
    kinked=KINKED,
    in_style=PLANE | SPACE | KINKED | {
        f"{D}D, overlap {x:.2g}": partial(rod.overlaps, D, x) for D in (2, 3) for x in OVERLAPS
    },
    without_newton=("longer than the box", "own images", "3D, own images"),
    style_in_units=chosen(PLANE, ALL_ALPHA) | {"jammed": JAMMED},
    mixed=partial(rod.of_two_types, 1.0),
    limits=LIMITS,
    stops={
        "crossing spines": rod.crossed,
        "spines crossing by 1e-12": partial(rod.crossed_by, 1e-12),
        "coincident centres": partial(rod.two, [[1.0, 1.0], [1.0, 1.0]], 0.3),
        "crossing through the boundary": partial(rod.two, [[5.9, 0.0], [-5.9, 0.2]], [0.0, 1.5]),
        "collinear and overlapping": partial(rod.two, [[1.0, 1.0], [1.5, 1.0]], 0.0),
        "coincident discs": partial(rod.two, [[1.0, 1.0], [1.0, 1.0]], 0.0, 0.0),
    },
    sentence="crossing spines or coinciding centres, where no contact force exists",
    invariant={"": Drive(JAMMED, 1e-4, 0.05, 200)},
    changed={
        "jammed": Drive(JAMMED, 1e-3, 0.02),
        "alpha 1e-6 to 100": Drive(PLANE[ALL_ALPHA], 1e-3, 0.02),
    },
    restarted={"jammed": Drive(JAMMED, 1e-3, 0.02, 100)},
    touch=Touch(rod.two_discs, 0.1, rod.RATE_OF_TWO_DISCS, 1.0, 0.0),
    lone=rod.lone,
    driven={
        **chosen(PLANE, ALL_ALPHA, "longer than the box", "own images", THIRD),
        **chosen(SPACE, "3D, own images", f"3D, {THIRD}"),
        **stacks(1e-6, 1e-9, 1e-14),
        **stacks(1e-6, 1e-14, dimension=3),
    },
    drive=fix(1e-4, 0.02),
    drive_limit=2e-13,
    minimised_by_lammps={
        **chosen(PLANE, ALL_ALPHA, "own images", THIRD),
        **chosen(SPACE, "3D, own images"),
        **stacks(1e-12),
    },
    two_ranks={
        "alpha 1e-6 to 100": Drive(PLANE[ALL_ALPHA], 0.0, 0.0),
        "own images": Drive(SPACE["3D, own images"], 0.0, 0.0),
        "jammed, in motion": Drive(JAMMED, 1e-3, 0.01, 200),
    },
    minimised={
        **chosen(PLANE, ALL_ALPHA, "sizes 1 to 10", "own images", THIRD),
        **chosen(SPACE, f"3D, {THIRD}"),
        **stacks(1e-6, 1e-14),
    },
    to_the_end=(THIRD, "own images", f"3D, {THIRD}"),
    jammed={
        "discs": partial(rod.jammed, 0.0, 16, 0.77),
        "rods of alpha 0.01": partial(rod.jammed, 0.01, 16, 0.77),
        "rods of alpha 1": partial(rod.jammed, 1.0, 16, 0.86),
        "rods of alpha 4": partial(rod.jammed, 4.0, 16, 0.8),
    },
    quick_targets=("rods of alpha 1",),
    targets_in_units=("discs", "rods of alpha 1"),
    modes_in_units=("discs", "rods of alpha 1"),
    spectra=("discs", "rods of alpha 0.01", "rods of alpha 4"),
    implicit=chosen(PLANE, ALL_ALPHA, "own images", THIRD) | stacks(1e-6, 1e-14),
    quasistatic={name: partial(rod.loose, *x) for name, x in OF_ONE_ALPHA.items()},
    quick_to_jam=("2D, alpha 0", "2D, alpha 1", "3D, alpha 0"),
    hard={name: partial(rod.hard, *x) for name, x in OF_ONE_ALPHA.items()},
)  # fmt: skip


# --- dimers --------------------------------------------------------------------------------------


def pair_of_dimers(*positions, angle=0.0):
    return partial(rod.two, list(positions), angle, style=DIMER)


def of_dimers_named(scenes):
    return {f"dimers, {name}": scene for name, scene in scenes.items()}


DIMERS_IN_PLANE = {
    ALL_ALPHA: partial(rod.all_aspect_ratios, 2, style=DIMER),
    "sizes 1 to 10": partial(rod.all_sizes, 2, style=DIMER),
    "own images": as_dimers(PLANE["own images"]),
    THIRD: partial(rod.deep, 2, style=DIMER),
}
DIMERS_IN_SPACE = {
    "3D, alpha 1e-6 to 10 in one box": partial(rod.all_aspect_ratios, 3, 10.0, DIMER),
    "3D, own images": as_dimers(SPACE["3D, own images"]),
    f"3D, {THIRD}": partial(rod.deep, 3, style=DIMER),
}
JAMMED_DIMERS = partial(rod.jammed, 1.0, style=DIMER)
DIMERS_OF_ONE_ALPHA = {name: x for name, x in OF_ONE_ALPHA.items() if x[1]}

DIMERS = Shape(
    name="dimers",
    style_name=DIMER,
    units=Overlaps,
    laws=(Law("", 2, is_of_oracle=True),),
    oracle=of_dimers,
    summed=DIMERS_IN_PLANE | DIMERS_IN_SPACE,
    bent=BENT,
    same_place=("coincident dimers", pair_of_dimers([1.0, 1.0], [5.0, 1.0], angle=0.3)),
    in_style=DIMERS_IN_PLANE | DIMERS_IN_SPACE | {
        f"{D}D, one to four bonds, overlap {x:.2g}": partial(rod.interlocked, D, x)
        for D in (2, 3) for x in OVERLAPS
    },
    without_newton=("own images", "3D, own images"),
    style_in_units={"jammed": JAMMED_DIMERS},
    mixed=partial(rod.of_two_types, 1.0, DIMER),
    limits=LIMITS,
    stops={
        "coincident centres": pair_of_dimers([1.0, 1.0], [1.0, 1.0], angle=0.3),
        "coincident discs": pair_of_dimers([0.0, 0.0], [2.0, 0.0]),
    },
    sentence="coinciding discs, where no contact force exists",
    invariant={"": Drive(JAMMED_DIMERS, 1e-4, 0.05, 200)},
    changed={"jammed": Drive(JAMMED_DIMERS, 1e-3, 0.02)},
    restarted={"jammed": Drive(JAMMED_DIMERS, 1e-3, 0.02, 100)},
    touch=Touch(rod.two_dimers, 0.1, rod.RATE_OF_TWO_DIMERS, 2.0, 0.0),
    lone=as_dimers(rod.lone),
    driven={
        **chosen(DIMERS_IN_PLANE, ALL_ALPHA, "own images", THIRD),
        **chosen(DIMERS_IN_SPACE, "3D, own images"),
    },
    drive=fix(1e-4, 0.02),
    drive_limit=2e-13,
    few_stops=True,
    minimised_by_lammps=chosen(DIMERS_IN_PLANE, "own images", THIRD),
    two_ranks={
        "own images": Drive(DIMERS_IN_SPACE["3D, own images"], 0.0, 0.0),
        "jammed, in motion": Drive(JAMMED_DIMERS, 1e-3, 0.01, 200),
    },
    minimised=of_dimers_named(DIMERS_IN_PLANE | chosen(DIMERS_IN_SPACE, "3D, own images")),
    to_the_end=(f"dimers, {THIRD}",),
    jammed={"dimers of alpha 1": partial(rod.jammed, 1.0, 16, 0.87, DIMER)},
    quick_targets=("dimers of alpha 1",),
    targets_in_units=("dimers of alpha 1",),
    modes_in_units=("dimers of alpha 1",),
    spectra=("dimers of alpha 1",),
    implicit=of_dimers_named(chosen(DIMERS_IN_PLANE, ALL_ALPHA, "own images")),
    quasistatic=of_dimers_named(
        {name: partial(rod.loose, *x, style=DIMER) for name, x in DIMERS_OF_ONE_ALPHA.items()}
    ),
    quick_to_jam=("dimers, 2D, alpha 1",),
    hard=of_dimers_named(
        {name: partial(rod.hard, *x, style=DIMER) for name, x in DIMERS_OF_ONE_ALPHA.items()}
    ),
)  # fmt: skip


# --- superellipsoids -----------------------------------------------------------------------------

SCATTERED = {
    "p 0.55 to 10 in one box": partial(ellipsoid.scattered, EXPONENTS, (1.0,)),
    "w 0.1 to 10 in one box": partial(ellipsoid.scattered, (1.0, 1.5), (0.1, 1.0, 10.0)),
    "2D, p 0.55 to 10, w to 10": partial(ellipsoid.scattered, (0.55, 1.0, 10.0), (10.0, 1.0), 2),
    THIRD: partial(ellipsoid.scattered, (0.75, 2.0), (1.0, 3.0), 3, 1 / 3),
    "own images, w 10": ellipsoid.needles,
}

# As LAMMPS takes them.
CROWDS = {
    **{f"p {p} {w}": partial(ellipsoid.of_one_shape, p, axes) for p in P for w, axes in W.items()},
    "all shapes": partial(ellipsoid.of_all_shapes, 3),
    "plane, all shapes": partial(ellipsoid.of_all_shapes, 2),
    "cubes face to face": partial(ellipsoid.in_a_row, 10.0, 0.5),
    "octahedra tip to tip": partial(ellipsoid.in_a_row, 0.55, 0.01),
    "nearly concentric": ellipsoid.nearly_concentric,
    "overlap of a third": partial(ellipsoid.overlapping_by, 1 / 3),
    "own images": partial(ellipsoid.tiny_box, 3, (10.0, 0.55)),
    "plane, own images": partial(ellipsoid.tiny_box, 2, (10.0, 0.55)),
}

SHAPES_OF_ONE = {
    f"{D}D, p {p:g}, w {w:g}": (D, p, w)
    for D in (2, 3) for p in (0.55, 1.0, 10.0) for w in (0.1, 1.0, 10.0)
}  # fmt: skip
DENSE = {f"{D}D": partial(ellipsoid.dense, D) for D in (2, 3)}

# Flat faces and sharp tips magnify rounding.
ROUNDING = 1e-12

SUPERELLIPSOIDS = Shape(
    name="superellipsoids",
    style_name="superellipsoid",
    units=Relative,
    laws=(Law("", 2, is_of_oracle=False),),
    counted=("p 0.55 to 10 in one box", "w 0.1 to 10 in one box", "own images, w 10"),
    summed=SCATTERED,
    rounding=ROUNDING,
    bent=("w 0.1 to 10 in one box", "own images, w 10", THIRD),
    bend=1e-6,
    same_place=("concentric bodies", ellipsoid.needles),
    in_style=CROWDS | {
        "p 0.55 to 10 in one box": ellipsoid.of_all_exponents,
        "spheres": ellipsoid.spheres_of_several_sizes,
    },
    without_newton=("own images", "plane, own images"),
    style_in_units=chosen(CROWDS, "all shapes", "plane, all shapes", "own images"),
    mixed=ellipsoid.of_two_types,
    limits=(ROUNDING,) * 3,
    stops={
        f"{D}D, coincident centres, p {p:g}": partial(ellipsoid.coincident, p, D)
        for p in (0.55, 1.0, 10.0) for D in (2, 3)
    },
    sentence="coinciding centres, where no contact force exists",
    invariant={f"{D}, ": Drive(scene, 1e-3, 0.01, 100) for D, scene in DENSE.items()},
    changed={D: Drive(scene, 1e-2, 0.01) for D, scene in DENSE.items()},
    restarted={D: Drive(scene, 1e-3, 0.02, 100) for D, scene in DENSE.items()},
    touch=Touch(ellipsoid.two_spheres, 1e-6, ellipsoid.RATE_OF_TWO_SPHERES, 1.0, 3.0),
    lone=ellipsoid.lone,
    driven=chosen(CROWDS, "all shapes", "plane, all shapes", "own images", "overlap of a third"),
    drive=fix(1e-4, 0.01, options="integrator heun/adaptive tolerance 1e-3"),
    drive_steps=2,
    drive_limit=ROUNDING,
    must_relax=True,
    drive_heavy=("all shapes",),
    minimised_by_lammps=chosen(CROWDS, "plane, all shapes", "own images", "plane, own images"),
    two_ranks={
        "own images": Drive(CROWDS["own images"], 0.0, 0.0),
        "p 0.55 and 10, w 0.1 and 10": Drive(CROWDS["all shapes"], 0.0, 0.0),
        "in motion": Drive(DENSE["3D"], 1e-3, 0.01, 50),
    },
    minimised=chosen(SCATTERED, "p 0.55 to 10 in one box", "w 0.1 to 10 in one box"),
    jammed={"spheroids": ellipsoid.jammed_spheroids},
    quick_targets=("spheroids",),
    targets_in_units=("spheroids",),
    # No modes in units: semi-axes, rounded in another unit, change quartic modes by more than their bounds.
    spectra=("spheroids",),
    implicit=chosen(SCATTERED, "2D, p 0.55 to 10, w to 10"),
    quasistatic={name: partial(ellipsoid.loose, *x) for name, x in SHAPES_OF_ONE.items()},
    quick_to_jam=("2D, p 1, w 1",),
    hard={name: partial(ellipsoid.hard, *x) for name, x in SHAPES_OF_ONE.items()},
    heavy_sweeps=tuple(name for name, (D, _, w) in SHAPES_OF_ONE.items() if D == 3 and w != 1),
)  # fmt: skip

SHAPES = (RODS, SUPERELLIPSOIDS, DIMERS)
