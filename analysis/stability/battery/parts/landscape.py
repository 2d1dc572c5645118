"""Cases of the stability battery: sums over packings."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from battery.case import Case
from battery.images import overlapping
from battery.oracle import Found
from battery.scenes.elongated import rods
from battery.scenes.making import LONG_EPS, Scene, every_image, scaled
from battery.shapes.shape import Oracle, Shape, is_long
from battery.shapes.table import RODS, SHAPES
from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State

UNITS = ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6))

CROSS = r"(spines|centres) of particles \d+ and \d+ cross"


# --- against the oracle --------------------------------------------------------------------------


@cache
def expected_of(scene: Scene, oracle: Oracle) -> Found:
    """Ask what the oracle says of a scene."""
    return oracle(scene(), 1.0, None)


def against_oracle(scene: Scene, oracle: Oracle) -> float:
    """Compare forces of one-bond contacts in long double, relative to the largest; contacts counted."""
    packing = scene()
    landscape, expected = Landscape(packing, sides=1), expected_of(scene, oracle)
    found = landscape.evaluate(State.of(packing))
    if found.n_bonds != expected.n_bonds:
        return np.inf
    components = landscape.components(found.gradient)
    D = packing.dimension
    by_force = np.abs(components[:, :D] + expected.force).max()
    turns = landscape.rotation_length > 0
    arm = np.where(turns, landscape.rotation_length, 1.0)
    by_torque = np.abs(components[:, D:] + expected.torque / arm[:, None])[turns]
    return float(max(by_force, by_torque.max(initial=0.0)) / expected.largest)


def contacts_lost(scene: Scene, oracle: Oracle | None) -> float:
    """Contacts that `find_contacts` has too few or too many, over all pairs and images."""
    packing = scene()
    network = find_contacts(packing)
    if oracle is not None:
        return float(abs(expected_of(scene, oracle).n_contacts - len(network.pairs)))
    pairs, shift = every_image(packing)
    touching = overlapping(packing, pairs, shift)
    expected = np.column_stack([pairs, shift])[touching].tolist()
    found = np.column_stack([network.pairs, network.shift]).tolist()
    return float(len({*map(tuple, expected)} ^ {*map(tuple, found)}))


# --- against itself ------------------------------------------------------------------------------


def slope_error(scene: Scene, size: float = 1e-6) -> float:
    """Differences of energies along random directions against forces, relative."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    length = landscape.components(np.ones(landscape.size))
    D, rng = packing.dimension, np.random.default_rng(6)
    length[:, :D] *= landscape.inner_radius[:, None]
    length[:, D:] *= landscape.rotation_length[:, None]
    scale = length[length > 0]
    gradient = landscape.evaluate(state).gradient
    largest = float(np.linalg.norm(gradient * scale))
    worst = 0.0
    for _ in range(6):
        v = scale * rng.normal(size=len(scale)) / np.sqrt(len(scale))
        ahead, behind = (
            landscape.evaluate(landscape.displaced(state, h * v)).energy for h in (size, -size)
        )
        worst = max(worst, abs((ahead - behind) / (2 * size) - float(gradient @ v)) / largest)
    return worst


def doubles_error(scene: Scene) -> float:
    """Doubles against long doubles, in overlaps."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    long, short = (landscape.evaluate(state, extended=x).gradient for x in (True, False))
    return float(np.abs(long - short).max() * 2 * landscape.inner_radius.min())


def moved_error(scene: Scene) -> float:
    """Move, wrap and reorder: change of forces relative to the largest."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    expected = landscape.components(landscape.evaluate(state).gradient)
    rng = np.random.default_rng(7)
    order = rng.permutation(packing.n)
    x = state.position + rng.random(packing.dimension) * state.edges
    x = x + rng.integers(-3, 4, x.shape) * state.edges
    names = ("diameters", "exponent", "species", "id")
    mixed = packing.with_(**{name: getattr(packing, name)[order] for name in names})
    other = Landscape(mixed)
    there = State(x[order], state.orientation[order], state.cell)
    found = other.components(other.evaluate(there).gradient)
    return float(np.abs(found - expected[order]).max() / np.abs(expected).max())


def units_error(scene: Scene, length: float, energy: float) -> float:
    """Give the same packing in other units: forces relative to the largest."""
    packing = scene()
    small, large = Landscape(packing), Landscape(scaled(packing, length), energy)
    a = small.evaluate(State.of(packing))
    b = large.evaluate(State.of(large.particles))
    if a.n_bonds != b.n_bonds:
        return np.inf
    change = np.abs(b.gradient * (length / energy) - a.gradient).max()
    return float(change / np.abs(a.gradient).max())


def second_derivatives(scene: Scene, h: float) -> float:
    """v.H v against differences of forces along v, relative: rotations in space do not commute."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    hessian = landscape.curvature(state, extended=True).hessian
    rng, worst = np.random.default_rng(8), 0.0
    size = float(landscape.inner_radius.min())
    turning = np.where(landscape.rotation_length > 0, landscape.rotation_length, size)
    part = np.minimum(turning, size)[landscape.particle_of_coordinate()]
    for _ in range(6):
        v = part * rng.normal(size=landscape.size)
        ahead, behind = (
            landscape.evaluate(landscape.displaced(state, x * v)).gradient for x in (h, -h)
        )
        size_of = float(np.abs(v) @ np.abs(hessian @ v))
        worst = max(worst, abs(float(v @ (ahead - behind)) / (2 * h) - v @ (hessian @ v)) / size_of)
    return worst


def at_one_place(scene: Scene) -> str:
    """Put the first two particles at one place."""
    packing = scene()
    first = packing.position[0]
    both = packing.with_(position=np.array([first, first, *packing.position[2:]]))
    Landscape(both).evaluate(State.of(both))
    return "no sentence"


def barely_touching(overlap: float) -> float:
    """Resolve in long double what a double drops: relative error of one force in a box of 1000."""
    packing = rods([[-400.3, 0.0], [-399.3, 0.0]], [0.0, 0.0], 0.0, 0.5, [1000.0, 1000.0])
    x = np.array([[-400.3, 0.1], [0.0, 0.1]], np.longdouble)
    x[1, 0] = x[0, 0] + 1 - np.longdouble(overlap)
    state = replace(State.of(packing), position=x)
    found = Landscape(packing).evaluate(state)
    true = 1 - (x[1, 0] - x[0, 0])
    rounding = LONG_EPS * 400 / overlap
    error = abs(float(found.gradient[0] / true) - 1)
    return max(error - 4 * rounding, 0.0)


# --- cases ---------------------------------------------------------------------------------------


def part_of(shape: Shape) -> str:
    """Name of the part, under which its cases stand."""
    return f"landscape, {shape.name}"


def counted(shape: Shape) -> list[Case]:
    """List cases that look at all images one by one."""
    own, part, oracle = shape.landscape, part_of(shape), shape.oracle
    lost, unit = "contacts too few or too many", "forces against long double over all images"
    all_scenes = {**own.scenes, **own.kinked}
    found = []
    for name in own.counted if oracle is None else all_scenes:
        run: Any = partial(contacts_lost, all_scenes[name], oracle)
        found.append(Case(part, f"{name}: contacts", lost, 0.0, run))
        if oracle is not None:
            run = partial(against_oracle, all_scenes[name], oracle)
            found.append(Case(part, f"{name}: forces", unit, 1e-14, run))
    return found


def consistent(shape: Shape, name: str, scene: Scene) -> list[Case]:
    """List cases of one scene that need no oracle."""
    part, rounding = part_of(shape), shape.landscape.rounding * (100 if is_long(name) else 1)
    slope, short = (
        "differences of energies against forces",
        "doubles against long doubles, in overlaps",
    )
    moved, scaled_ = "change of forces by moving, wrapping, order", "change of scaled forces"
    found = [
        Case(part, f"{name}: slopes", slope, 1e-7, partial(slope_error, scene)),
        Case(part, f"{name}: doubles", short, rounding, partial(doubles_error, scene)),
        Case(part, f"{name}: moved", moved, 1e-13, partial(moved_error, scene)),
    ]
    for length, energy in UNITS:
        label = f"{name}: length {length:g}, k_e {energy:g}"
        run = partial(units_error, scene, length, energy)
        found.append(Case(part, label, scaled_, 1e-12, run))
    return found


def cases_of(shape: Shape) -> list[Case]:
    """List all cases of a shape."""
    own, part = shape.landscape, part_of(shape)
    found = counted(shape)
    for name, scene in own.scenes.items():
        found += consistent(shape, name, scene)
    for name in own.bent:
        run: Any = partial(second_derivatives, own.scenes[name], own.bend)
        what = "Hessian against differences of forces"
        found.append(Case(part, f"{name}: Hessian", what, 1e-6, run))
    name, scene = own.same_place
    found.append(Case(part, name, "sentence", CROSS, partial(at_one_place, scene)))
    return found


def cases() -> list[Case]:
    """All of them."""
    found = [case for shape in SHAPES for case in cases_of(shape)]
    for overlap in (1e-6, 1e-10, 1e-14):
        run = partial(barely_touching, overlap)
        name, what = f"overlap {overlap:g} in a box of 1000", "relative error beyond rounding of x"
        found.append(Case(part_of(RODS), name, what, 1e-15, run))
    return found
