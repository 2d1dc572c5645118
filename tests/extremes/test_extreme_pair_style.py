"""Pair styles in LAMMPS."""

import numpy as np
from extreme import case, extreme
from extreme_in_lammps import SKIN, after, difference, expected_of
from extreme_rods import jammed
from extreme_shapes import SHAPES, is_long
from extreme_superellipsoids import all_sizes
from packings_in_a_box import EPS, contacts_of, scaled

from jamshape.contacts import find_contacts

LAWS = [(shape, law) for shape in SHAPES for law in shape.laws]


def label_of(shape, law, name):
    return f"pair {shape.style_name}/harmonic: {name}{law.words}"


def of_forces():
    for shape, law in LAWS:
        judge = "long double over all images" if law.is_of_oracle else "bindings"
        options = {"measure": f"forces against {judge}, {shape.units.words}"}
        for name, scene in shape.in_style.items():
            # Tips are rounded by the length of a rod times EPS, and one bond's lever arm at 1e-14 by nothing else.
            options["expected"] = shape.limits[0] * (5 if is_long(name) else 1)
            label = label_of(shape, law, name)
            yield case(label, scene, shape, law, **options)
            if name in shape.without_newton:
                yield case(f"{label}, newton off", scene, shape, law, 1.0, "off", **options)
        options["expected"] = shape.limits[2]
        for name, scene in shape.style_in_units.items():
            for k_e in (1e-6, 1e6):
                label = f"{label_of(shape, law, name)}, k_e {k_e:g}"
                yield case(label, scene, shape, law, k_e, **options)


@extreme("forces against another evaluation", of_forces())
def test_forces(scene, shape, law, k_e=1.0, newton="on"):
    at = after(scene(), "run 0", sides=law.sides, k_e=k_e, newton=newton)
    return difference(at, shape, expected_of(at, shape, law, k_e), k_e)


@extreme("change of scaled forces", [
    case(f"{label_of(shape, law, name)}, unit of length {length:g}", scene, shape, law, length,
         expected=shape.limits[2], measure=f"change of scaled forces, {shape.units.words}")
    for shape, law in LAWS for name, scene in shape.style_in_units.items()
    for length in (1e-6, 1e-3, 1e3, 1e6)
])  # fmt: skip
def test_units_of_length(scene, shape, law, length):
    """The skin is scaled, too."""
    a, b = (
        after(scaled(scene(), unit), "run 0", sides=law.sides, skin=SKIN * unit)
        for unit in (1.0, length)
    )
    if a.n_bonds != b.n_bonds:
        return np.inf
    unit = shape.units.force(a.packing, a.force, 1.0)
    return np.abs(b.force * length - a.force).max() / unit


STIFFNESS = {(1, 1): 1e-6, (2, 2): 1e6, (1, 2): 1.0}


@extreme("forces against sums by type", [
    case(label_of(shape, law, "k_e 1e-6, 1 and 1e6 in one box"), shape, law, expected=shape.limits[1],
         measure=f"forces against sums by type, {shape.units.words}")
    for shape, law in LAWS
])  # fmt: skip
def test_orders_of_k_e(shape, law):
    """Over the forces of the particle's contacts."""
    packing = shape.mixed()
    stiffness = "".join(f"\npair_coeff {i} {j} {k!r}" for (i, j), k in STIFFNESS.items())
    at = after(packing, "run 0", stiffness, sides=law.sides)
    network = find_contacts(at.packing, 1.0, law.sides)
    types = np.sort(packing.species[network.pairs], axis=1)
    k_e = np.array([STIFFNESS[(a, b)] for a, b in types.tolist()])
    expected, sizes = np.zeros_like(at.force), np.zeros(packing.n)
    for which, sign in ((0, 1), (1, -1)):
        np.add.at(expected, network.pairs[:, which], sign * k_e[:, None] * network.force)
        np.add.at(sizes, network.pairs[:, which], k_e * shape.units.contacts(network.force, 1.0))
    wrong = np.abs(at.force - expected).max(axis=1)
    return (wrong / np.maximum(sizes, 1e-300)).max()


@extreme("forces pair by pair, over rounding and bounds", [
    case(f"pair superellipsoid/harmonic: sizes 1e-6 to 100 in one box, p {p:g}", p) for p in (0.75, 1.0, 1.5)
], 8.0)  # fmt: skip
def test_sizes_in_one_box(p):
    at = after(all_sizes(p), "run 0")
    pairs = np.arange(at.packing.n).reshape(-1, 2)
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
    allowed = (4 / r**2 + force / small) * rounded + EPS * 4 / r + contact["force_error"]
    return (error / allowed).max()


@extreme("", [
    case(label_of(shape, law, name), scene, law, expected=shape.sentence)
    for shape in SHAPES for name, scene in shape.stops.items()
    for law in (shape.laws if "cross" in name else shape.laws[-1:])
])  # fmt: skip
def test_no_force_exists(scene, law):
    after(scene(), "run 0", sides=law.sides)


RODS = "pair spherocylinder/harmonic"


@extreme("", [
    case(f"{RODS}: unit of length 1e6 in a plane of thickness 1, in bins", 1e6, 29.0,
         expected="Cannot use neighbor bins - box size << cutoff"),
    case(f"{RODS}: skin 1e5 times the box", 1e-6, SKIN, expected="skin|cutoff|neighbor|Neighbor", heavy=True),
])  # fmt: skip
def test_skins(length, skin):
    """A skin far above the box asks for images beyond counting."""
    after(scaled(jammed(1.0), length), "run 0", skin=skin)
