"""Sums of contacts over packings: beside the oracle, and consistent with themselves."""

from dataclasses import replace
from functools import cache

import numpy as np
from extreme import case, extreme
from extreme_rods import rods
from extreme_shapes import SHAPES, is_long
from packings_in_a_box import LONG_EPS, every_image, scaled

from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape, State

UNITS = ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6))

CROSS = r"(spines|centres) of particles \d+ and \d+ cross"

SCENES = [
    (shape, f"landscape, {shape.name}: {name}", scene)
    for shape in SHAPES
    for name, scene in shape.summed.items()
]
COUNTED = [
    (f"landscape, {shape.name}: {name}", scene, shape.oracle)
    for shape in SHAPES
    for name, scene in (shape.summed | shape.kinked).items()
    if shape.oracle or name in shape.counted
]


# --- beside the oracle ---------------------------------------------------------------------------


@cache
def expected_of(scene, oracle):
    return oracle(scene())


@extreme("forces against long double over all images", [
    case(f"{label}: forces", scene, oracle) for label, scene, oracle in COUNTED if oracle
], 1e-14)  # fmt: skip
def test_forces(scene, oracle):
    """One-bond contacts, relative to the largest; contacts counted."""
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
    return max(by_force, by_torque.max(initial=0.0)) / expected.largest


@extreme("contacts too few or too many", [
    case(f"{label}: contacts", scene, oracle) for label, scene, oracle in COUNTED
], 0.0)  # fmt: skip
def test_contacts(scene, oracle):
    packing = scene()
    network = find_contacts(packing)
    if oracle:
        return abs(expected_of(scene, oracle).n_contacts - len(network.pairs))
    pairs, shift = every_image(packing)
    touching = packing.compiled().overlaps(*State.of(packing).split, pairs, shift)
    expected = np.column_stack([pairs, shift])[touching].tolist()
    found = np.column_stack([network.pairs, network.shift]).tolist()
    return len({*map(tuple, expected)} ^ {*map(tuple, found)})


# --- consistent ----------------------------------------------------------------------------------


@extreme("differences of energies against forces", [
    case(f"{label}: slopes", scene) for _, label, scene in SCENES
], 1e-7)  # fmt: skip
def test_slopes(scene, h=1e-6):
    """Along random directions, relative."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    length = landscape.components(np.ones(landscape.size))
    D, rng = packing.dimension, np.random.default_rng(6)
    length[:, :D] *= landscape.inner_radius[:, None]
    length[:, D:] *= landscape.rotation_length[:, None]
    scale = length[length > 0]
    gradient = landscape.evaluate(state).gradient
    worst = 0.0
    for _ in range(6):
        v = scale * rng.normal(size=len(scale)) / np.sqrt(len(scale))
        ahead, behind = (
            landscape.evaluate(landscape.displaced(state, x * v)).energy for x in (h, -h)
        )
        worst = max(worst, abs((ahead - behind) / (2 * h) - float(gradient @ v)))
    return worst / float(np.linalg.norm(gradient * scale))


@extreme("doubles against long doubles, in overlaps", [
    case(f"{label}: doubles", scene, expected=shape.rounding * (100 if is_long(label) else 1))
    for shape, label, scene in SCENES
])  # fmt: skip
def test_doubles(scene):
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    long, short = (landscape.evaluate(state, extended=x).gradient for x in (True, False))
    return np.abs(long - short).max() * 2 * landscape.inner_radius.min()


@extreme("change of forces by moving, wrapping, order", [
    case(f"{label}: moved", scene) for _, label, scene in SCENES
], 1e-13)  # fmt: skip
def test_moved(scene):
    """Relative to the largest."""
    packing = scene()
    landscape, state = Landscape(packing), State.of(packing)
    expected = landscape.components(landscape.evaluate(state).gradient)
    rng = np.random.default_rng(7)
    order = rng.permutation(packing.n)
    x = state.position + rng.random(packing.dimension) * state.edges
    x = x + rng.integers(-3, 4, x.shape) * state.edges
    names = ("diameters", "exponent", "species", "id")
    other = Landscape(packing.with_(**{name: getattr(packing, name)[order] for name in names}))
    there = State(x[order], state.orientation[order], state.cell)
    found = other.components(other.evaluate(there).gradient)
    return np.abs(found - expected[order]).max() / np.abs(expected).max()


@extreme("change of scaled forces", [
    case(f"{label}: length {length:g}, k_e {energy:g}", scene, length, energy)
    for _, label, scene in SCENES for length, energy in UNITS
], 1e-12)  # fmt: skip
def test_units(scene, length, energy):
    packing = scene()
    small, large = Landscape(packing), Landscape(scaled(packing, length), energy)
    a, b = (x.evaluate(State.of(x.particles)) for x in (small, large))
    if a.n_bonds != b.n_bonds:
        return np.inf
    change = np.abs(b.gradient * (length / energy) - a.gradient).max()
    return change / np.abs(a.gradient).max()


@extreme("Hessian against differences of forces", [
    case(f"landscape, {shape.name}: {name}: Hessian", shape.summed[name], shape.bend)
    for shape in SHAPES for name in shape.bent
], 1e-6)  # fmt: skip
def test_hessian(scene, h):
    """v.H v, relative: rotations in space do not commute."""
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
        bend = hessian @ v
        error = abs(float(v @ (ahead - behind)) / (2 * h) - v @ bend)
        worst = max(worst, error / float(np.abs(v) @ np.abs(bend)))
    return worst


# --- two particles -------------------------------------------------------------------------------


@extreme("", [
    case(f"landscape, {shape.name}: {shape.same_place[0]}", shape.same_place[1])
    for shape in SHAPES
], CROSS)  # fmt: skip
def test_two_at_one_place(scene):
    packing = scene()
    x = packing.position.copy()
    x[1] = x[0]
    both = packing.with_(position=x)
    Landscape(both).evaluate(State.of(both))


@extreme("relative error beyond rounding of x", [
    case(f"landscape, spherocylinders: overlap {overlap:g} in a box of 1000", overlap)
    for overlap in (1e-6, 1e-10, 1e-14)
], 1e-15)  # fmt: skip
def test_barely_touching(overlap):
    """Long doubles resolve a force that doubles drop."""
    packing = rods([[-400.3, 0.0], [-399.3, 0.0]], 0.0, 0.0, 0.5, [1000.0, 1000.0])
    x = np.array([[-400.3, 0.1], [0.0, 0.1]], np.longdouble)
    x[1, 0] = x[0, 0] + 1 - np.longdouble(overlap)
    found = Landscape(packing).evaluate(replace(State.of(packing), position=x))
    error = abs(float(found.gradient[0] / (1 - (x[1, 0] - x[0, 0]))) - 1)
    return max(error - 4 * LONG_EPS * 400 / overlap, 0.0)
