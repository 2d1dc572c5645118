"""Cases of the stability battery: pair styles in LAMMPS."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from battery.case import Case
from battery.images import contacts_of
from battery.scenes.elongated import jammed
from battery.scenes.making import EPS, Scene, scaled
from battery.scenes.superellipsoids import all_sizes
from battery.session import SKIN, Frame, Setting, bonds_in, frame, loaded, sentence, set_up
from battery.shapes.shape import Law, Shape, is_long
from battery.shapes.table import RODS, SHAPES, SUPERELLIPSOIDS
from jamshape.arrays import LongArray
from jamshape.contacts import find_contacts, sum_forces


class Expected(NamedTuple):
    """What another evaluation says of a state in LAMMPS."""

    force: LongArray
    torque: LongArray
    n_bonds: int


def expected_of(at: Frame, shape: Shape, law: Law, k_e: float = 1.0) -> Expected:
    """Ask the oracle where it knows the law, else the bindings."""
    if law.is_of_oracle and shape.oracle is not None:
        seen = shape.oracle(at.packing, k_e, at.quaternion)
        return Expected(seen.force, seen.torque, seen.n_bonds)
    network = find_contacts(at.packing, k_e, law.sides)
    found = sum_forces(at.packing, network)
    force = np.asarray(found.force, np.longdouble)
    torque = np.asarray(found.torque, np.longdouble).reshape(at.packing.n, -1)
    return Expected(force, torque, int(network.n_bonds.sum()))


def difference(at: Frame, shape: Shape, expected: Expected, k_e: float = 1.0) -> float:
    """Largest difference of forces and of torques, in the units of the shape; infinite if one is not finite."""
    if not at.is_finite:
        return np.inf
    units, packing = shape.units, at.packing
    force = units.force(packing, np.asarray(expected.force, float), k_e)
    torque = units.torque(packing, np.asarray(expected.torque, float), force)
    by_force = np.abs(at.force - expected.force).max() / force
    return float(max(by_force, np.abs((at.torque - expected.torque) / torque).max()))


# --- what is judged ------------------------------------------------------------------------------


def force_error(
    scene: Scene, shape: Shape, law: Law, k_e: float = 1.0, newton: str = "on"
) -> float:
    """Compare forces with another evaluation; bonds counted."""
    packing = scene()
    with loaded(packing, set_up(packing, Setting(law.sides, k_e)), newton) as session:
        session.commands("run 0")
        at, bonds = frame(session, packing), bonds_in(session)
    expected = expected_of(at, shape, law, k_e)
    return difference(at, shape, expected, k_e) if bonds == expected.n_bonds else np.inf


def other_unit(scene: Scene, shape: Shape, law: Law, length: float) -> float:
    """Give the same packing with all lengths scaled, the skin too: change of forces."""
    found = []
    for factor in (1.0, length):
        packing = scaled(scene(), factor)
        with loaded(packing, set_up(packing, Setting(law.sides, 1.0, SKIN * factor))) as session:
            session.commands("run 0")
            found.append((frame(session, packing), bonds_in(session)))
    (a, bonds), (b, bonds_there) = found
    if bonds != bonds_there:
        return np.inf
    unit = shape.units.force(a.packing, a.force, 1.0)
    return float(np.abs(b.force * length - a.force).max() / unit)


STIFFNESS = {(1, 1): 1e-6, (2, 2): 1e6, (1, 2): 1.0}


def orders_of_k_e(shape: Shape, law: Law) -> float:
    """Stiffness from 1e-6 to 1e6 between types of one packing: forces over those of the particle's contacts."""
    packing = shape.style.mixed()
    text = set_up(packing, Setting(law.sides))
    for (i, j), k in STIFFNESS.items():
        text += f"\npair_coeff {i} {j} {k!r}"
    with loaded(packing, text) as session:
        session.commands("run 0")
        at = frame(session, packing)
    network = find_contacts(at.packing, 1.0, law.sides)
    types = np.sort(packing.species[network.pairs], axis=1)
    k_e = np.array([STIFFNESS[(a, b)] for a, b in types.tolist()])
    expected, sizes = np.zeros_like(at.force), np.zeros(packing.n)
    for which, sign in ((0, 1), (1, -1)):
        np.add.at(expected, network.pairs[:, which], sign * k_e[:, None] * network.force)
        np.add.at(sizes, network.pairs[:, which], k_e * shape.units.of_contacts(network.force, 1.0))
    wrong = np.abs(at.force - expected).max(axis=1)
    return float((wrong / np.maximum(sizes, 1e-300)).max())


def lost_digits(p: float) -> float:
    """Compare forces of all sizes with the contacts pair by pair, over what rounding and the bounds of eta allow."""
    packing = all_sizes(p)
    with loaded(packing, set_up(packing)) as session:
        session.commands("run 0")
        at = frame(session, packing)
    pairs = np.arange(packing.n).reshape(-1, 2)
    contact = contacts_of(at.packing, pairs, np.zeros((len(pairs), 3), np.int64))
    if len(contact["pair"]) != len(pairs):
        return np.inf
    error = np.abs(at.force[::2] - contact["force"]).max(axis=1)
    error = np.maximum(error, np.abs(at.force[1::2] + contact["force"]).max(axis=1))
    # U = k_e (1 - eta^2)^2 / 2 has the stiffness 4 k_e / r^2 along r, and F / R across, R the smaller
    # size; a coordinate is rounded by half its spacing on either side.
    x = at.packing.position.reshape(-1, 6)
    r = np.linalg.norm(x[:, 3:] - x[:, :3], axis=1)
    small = at.packing.diameters[1::2].min(axis=1) / 2
    force = np.linalg.norm(contact["force"], axis=1)
    rounded = EPS * np.abs(x).max(axis=1)
    allowed = (4 / r**2 + force / small) * rounded + EPS * 4 / r
    allowed += contact["force_error"]
    return float((error / allowed).max())


def stopped(scene: Scene, sides: int) -> str:
    """Say what the first evaluation stops with."""
    packing = scene()
    return sentence(packing, set_up(packing, Setting(sides)) + "\nrun 0")


def in_bins(length: float, skin: float) -> str:
    """Give rods in another unit, but their skin: a list of images beyond counting."""
    packing = scaled(jammed(1.0), length)
    return sentence(packing, set_up(packing, Setting(skin=skin)) + "\nrun 0")


# --- cases ---------------------------------------------------------------------------------------


def part_of(shape: Shape) -> str:
    """Name of the part, under which its cases stand."""
    return f"pair {shape.style_name}/harmonic"


def limit_of(shape: Shape, name: str) -> float:
    """Tips are rounded by the length of a rod times EPS, and one bond's lever arm at 1e-14 by nothing else."""
    return shape.style.limits.force * (5 if is_long(name) else 1)


def of_forces(shape: Shape, law: Law) -> Iterator[Case]:
    """List forces of all scenes."""
    own, part = shape.style, part_of(shape)
    judge = "long double over all images" if law.is_of_oracle else "bindings"
    what = f"forces against {judge}, {shape.units.words}"
    for name, scene in own.scenes.items():
        limit = limit_of(shape, name)
        yield Case(part, f"{name}{law.words}", what, limit, partial(force_error, scene, shape, law))
        if name in own.without_newton:
            run = partial(force_error, scene, shape, law, newton="off")
            yield Case(part, f"{name}{law.words}, newton off", what, limit, run)
    for name, scene in own.in_units.items():
        for k_e in (1e-6, 1e6):
            run = partial(force_error, scene, shape, law, k_e)
            yield Case(part, f"{name}{law.words}, k_e {k_e:g}", what, own.limits.units, run)


def of_units(shape: Shape, law: Law) -> Iterator[Case]:
    """List forces in other units, and of several stiffnesses in one box."""
    own, part, words = shape.style, part_of(shape), shape.units.words
    for name, scene in own.in_units.items():
        for length in (1e-6, 1e-3, 1e3, 1e6):
            label, run = (
                f"{name}{law.words}, unit of length {length:g}",
                partial(other_unit, scene, shape, law, length),
            )
            yield Case(part, label, f"change of scaled forces, {words}", own.limits.units, run)
    label, what = (
        f"k_e 1e-6, 1 and 1e6 in one box{law.words}",
        f"forces against sums by type, {words}",
    )
    yield Case(part, label, what, own.limits.mixed, partial(orders_of_k_e, shape, law))


def of_stops(shape: Shape) -> Iterator[Case]:
    """List what ends with a sentence."""
    for name, scene in shape.style.stops.items():
        for law in shape.laws if "cross" in name else shape.laws[-1:]:
            run: Any = partial(stopped, scene, law.sides)
            yield Case(part_of(shape), f"{name}{law.words}", "sentence", shape.style.sentence, run)


def cases() -> list[Case]:
    """All of them."""
    found: list[Case] = []
    for shape in SHAPES:
        for law in shape.laws:
            found += [*of_forces(shape, law), *of_units(shape, law)]
        found += of_stops(shape)
    for p in (0.75, 1.0, 1.5):
        label, run = f"sizes 1e-6 to 100 in one box, p {p:g}", partial(lost_digits, p)
        what = "forces pair by pair, over rounding and bounds"
        found.append(Case(part_of(SUPERELLIPSOIDS), label, what, 8.0, run))
    # A skin far above the box asks for images beyond counting.
    label, words = (
        "unit of length 1e6 in a plane of thickness 1, in bins",
        "Cannot use neighbor bins - box size << cutoff",
    )
    found.append(Case(part_of(RODS), label, "sentence", words, partial(in_bins, 1e6, 29.0)))
    label, words = "skin 1e5 times the box", r"skin|cutoff|neighbor|Neighbor"
    found.append(
        Case(part_of(RODS), label, "sentence", words, partial(in_bins, 1e-6, SKIN), heavy=True)
    )
    return found
