"""Comparisons for each shape."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.lammps_text import write_data
from jamshape.packing import Packing
from jamshape.shapes.clump import bumpy_discs
from jamshape.shapes.principal import text_of
from jamshape.shapes.solid import RoundedPolygon
from jamshape.shapes.spheropolygon import regular_polygon
from pair_styles.decks import SKIN, Bench, Case, Style, ours

CONTACTS = {"1 1": 1.0, "1 2": 1.2, "2 2": 1.4}  # R_i + R_j of the types
ELLIPSOIDS = "atom_style ellipsoid"

_DISCS = "--alpha 0"
_BUMPY = text_of(bumpy_discs(11))
_SQUARE = text_of(regular_polygon(4).round(15))
_FLIGHT = "velocity all create 1 1\nfix flow all nve/noforce\ntimestep 1.5e-3"


def fixed(text: str, _: Packing) -> str:
    """Give the same input for all packings."""
    return text


def reaching(text: str, packing: Packing) -> str:
    """Give input with the longest diameter, so that no contact is out of reach."""
    return text.format(reach=2 * float(packing.outer_radius.max()))


def corners_of(packing: Packing, i: int) -> tuple[FloatArray, float]:
    """Corners of a rounded body in the plane in its own coordinates, and its radius."""
    solid = packing.shape.solid(packing.diameters[i], packing.form[i])
    if isinstance(solid, RoundedPolygon):
        return solid.corners, solid.radius
    half_length, radius = packing.half_length[i], float(packing.radius[i])
    return np.array([[1.0, 0.0], [-1.0, 0.0]]) * half_length, radius


def write_other(path: Path, packing: Packing, *, bodies: bool) -> None:
    """Write a data file for `atom_style body rounded/polygon` or, of discs, `atomic`."""
    write_data(path, packing)
    head, _, text = path.read_text().partition("Atoms # ellipsoid")
    atoms = text.partition("\nEllipsoids")[0]
    if bodies:
        every = [body_lines(packing, i) for i in range(packing.n)]
        text = "\n".join([f"Atoms{atoms}\nBodies\n", *every, ""])
    else:
        text = "Masses\n\n1 1\n2 1\n\nAtoms" + re.sub(r"(?m)^(\d+ \d) 1 1 ", r"\1 ", atoms)
    head = head.replace(f"{packing.n} ellipsoids", f"{packing.n} bodies" if bodies else "")
    path.write_text(head + text)


def body_lines(packing: Packing, i: int) -> str:
    """Write a body of unit moments of inertia for `Bodies`: corners in space, and the diameter."""
    corners, radius = corners_of(packing, i)
    along = packing.axes[i]
    turned = corners @ np.array([along, [-along[1], along[0]]])
    places = " ".join(f"{x} {y} 0" for x, y in turned.tolist())
    n = len(corners)
    return f"{packing.id[i]} 1 {7 + 3 * n}\n{n}\n1 1 2 0 0 0\n{places} {2 * radius}"


POLYGON = Style(
    # Two vertices each, but `2 2` crashes: a rod is smaller than its smallest chunk of memory.
    atoms="atom_style body rounded/polygon 1 2\ncomm_modify vel yes",
    # No damping, friction or attraction, and no force that grows with the length of contact.
    pair=partial(fixed, "pair_style body/rounded/polygon 0 0 0 1e9 0\npair_coeff * * 1 0"),
    write=partial(write_other, bodies=True),
    nve="fix flow all nve/body\ntimestep 1e-6",
    skin=SKIN + max(CONTACTS.values()),  # its cutoff leaves out the radii: contacts would be lost
)
WCA = Style(
    atoms="atom_style atomic",
    pair=partial(
        fixed,
        "pair_style lj/cut 1\n"
        + "\n".join(f"pair_coeff {ij} 1 {d} {d * 2 ** (1 / 6)}" for ij, d in CONTACTS.items()),
    ),
    write=partial(write_other, bodies=False),
    nve="fix flow all nve\ntimestep 1e-6",
    instead=_DISCS,
)
_SLOWLY = "fix flow all nve/asphere\ntimestep 1e-6"
_OF_ELLIPSOIDS = partial(Style, ELLIPSOIDS, write=write_data, nve=_FLIGHT)
GAYBERNE = _OF_ELLIPSOIDS(
    partial(reaching, "pair_style gayberne 1 1 1 {reach}\npair_coeff * * 1 2 1 1 1 1 1 1")
)
RESQUARED = _OF_ELLIPSOIDS(
    partial(reaching, "pair_style resquared {reach}\npair_coeff * * 1 1 1 1 1 1 1 1")
)
GRANULAR = Style(
    atoms="atom_style ellipsoid superellipsoid\nnewton off\ncomm_modify vel yes",
    pair=partial(
        fixed,
        "pair_style granular/superellipsoid\n"
        "pair_coeff * * hooke 1 0 tangential classic 0 0 0 damping mass_velocity",
    ),
    write=partial(write_data, blocks=True),
    nve=_FLIGHT,
    is_everywhere=False,
)

_PLANE = Bench(
    dimension=2,
    cases=(),
    n=(1024, 10000),
    compress="--kappa 1e-3 --dt 0.1 --frames 1",
    step="fix flow all overdamped/affine drag 1 compress 1e-4 integrator heun\ntimestep 0.05",
    most_steps={"step": 2000},  # 1 % of strain, 2 % of phi
    styles={},
    faster_than={},
    dearer_than={},
    tiles=(3, 4, 5, 6),
)

BENCHES = {
    "spherocylinder": _PLANE._replace(
        cases=(Case("alpha 4", "--alpha 4", (0.5, 0.86)),),
        styles={
            "ours-one": ours(1, ELLIPSOIDS, _SLOWLY),
            "ours-two": ours(2, ELLIPSOIDS, _SLOWLY),
            "polygon": POLYGON,
            "wca": WCA,
        },
        faster_than={"speed over polygon (>= 10)": "polygon"},
        dearer_than={"cost over wca (<= 4)": "wca"},
    ),
    "dimer": _PLANE._replace(
        cases=(Case("alpha 1", "--shape dimer --alpha 1", (0.5, 0.86)),),
        styles={"ours": ours(2, ELLIPSOIDS, _SLOWLY), "wca": WCA},
        dearer_than={"cost over wca": "wca"},
    ),
    "clump": _PLANE._replace(
        # Bumps are stiff, so that a fixed step would be short.
        compress="--kappa 1e-3 --integrator rkc2 --integration-tolerance 1e-2 --frames 1",
        cases=(Case("bumpy, 12 discs", f"--shape clump --discs '{_BUMPY}'", (0.5, 0.82)),),
        styles={
            "ours": ours(2, ELLIPSOIDS, _SLOWLY),
            "ours-dimer": ours(2, ELLIPSOIDS, _SLOWLY)._replace(instead="--shape dimer --alpha 1"),
            "wca": WCA,
        },
        dearer_than={"cost over dimers (<= 6)": "ours-dimer", "cost over wca": "wca"},
    ),
    "spheropolygon": _PLANE._replace(
        cases=(
            Case(
                "squares",
                f"--shape spheropolygon --corners '{_SQUARE}' --rounding 0.3",
                (0.5, 0.86),
            ),
        ),
        styles={
            "ours": ours(2, ELLIPSOIDS, _SLOWLY),
            "ours-rod": ours(2, ELLIPSOIDS, _SLOWLY)._replace(instead="--alpha 1"),
            "polygon": POLYGON._replace(
                atoms="atom_style body rounded/polygon 1 4\ncomm_modify vel yes"
            ),
            "wca": WCA,
        },
        faster_than={"speed over polygon": "polygon"},
        dearer_than={"cost over rods (<= 3)": "ours-rod", "cost over wca": "wca"},
    ),
    "superellipsoid": Bench(
        dimension=3,
        cases=tuple(
            Case(f"p {p}, w {w}", f"--shape superellipsoid --p {p} --w2 {w}", (phi,))
            for w in (1.5, 3)
            for p, phi in ((1, 0.70), (2, 0.72))
        ),
        n=(1000,),
        compress="--kappa 1e-2 --integrator rkc2 --integration-tolerance 1e-2 --phi-start 0.15 --frames 1",
        step="fix flow all overdamped/affine drag 1 compress 1e-5 integrator heun\ntimestep 0.01",
        most_steps={"nve": 200, "step": 2000},
        styles={
            "ours": ours(2, ELLIPSOIDS, _FLIGHT),
            "gayberne": GAYBERNE,
            "resquared": RESQUARED,
            "granular": GRANULAR,
        },
        faster_than={"speed over gayberne": "gayberne", "speed over granular": "granular"},
        dearer_than={},
        tiles=(2, 3, 4),
    ),
}
