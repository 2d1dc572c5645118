"""Packings of rods, and comparisons of states, for the tests of the styles."""

from __future__ import annotations

import functools
import tempfile
from contextlib import suppress

import numpy as np
from lammps_runs import loaded, state_of

from jamshape import contacts
from jamshape.packing import Box, Packing

# --- comparisons ---------------------------------------------------------------------------------


def gradient_by_differences(session, state, step):
    """Central differences of the energy by every position and every rotation, through `run 0`."""
    D, n = state.packing.dimension, state.packing.n
    x = session.lmp.numpy.extract_atom("x")

    def energy_after(command=""):
        session.commands(f"{command}\nrun 0 post no")
        return session.lmp.get_thermo("pe")

    by_position = np.zeros((n, D))
    for row, k in np.ndindex(n, D):
        atom = session.lmp.numpy.extract_atom("id")[:n].tolist().index(state.packing.id[row])
        at = x[atom, k]
        x[atom, k] = ahead = at + step
        rise = energy_after()
        x[atom, k] = behind = at - step
        rise -= energy_after()
        x[atom, k] = at
        by_position[row, k] = rise / (ahead - behind)

    axes = np.eye(3)[2:] if D == 2 else np.eye(3)
    by_rotation = np.zeros((n, len(axes)))
    for row, k in np.ndindex(*by_rotation.shape):
        q, rise = state.quaternion[row], 0.0
        lever = state.packing.diameters[row, 0] / 2
        for sign in (1, -1):
            turn = quaternion_product(rotation_by(sign * step / lever * axes[k]), q)
            rise += sign * energy_after(set_quaternion(state.packing.id[row], turn))
        energy_after(set_quaternion(state.packing.id[row], q))
        by_rotation[row, k] = rise * lever / (2 * step)
    return by_position, by_rotation if D == 3 else by_rotation[:, 0]


def set_quaternion(tag, q):
    """LAMMPS takes an axis and an angle in degrees."""
    length = np.linalg.norm(q[1:])
    axis = q[1:] / length if length else np.array([0.0, 0.0, 1.0])
    degrees = np.degrees(2 * np.arctan2(length, q[0]))
    return f"set atom {tag} quat {' '.join(f'{c:.17g}' for c in axis)} {degrees:.17g}"


def nearest_image(separation, box):
    return separation - box.edges * np.round(separation / box.edges)


def angle_between(quaternion, other):
    """Angles of the rotations from one to the other; small ones to full relative accuracy."""
    other = np.where((quaternion * other).sum(axis=1, keepdims=True) < 0, -other, other)
    half_chord = 0.5 * np.linalg.norm(quaternion - other, axis=1)
    return 4.0 * np.arcsin(np.minimum(half_chord, 1.0))


def pose_differences(a, b):
    """Largest distance over the box edge and largest angle between two states of one system."""
    np.testing.assert_array_equal(a.packing.id, b.packing.id)
    apart = nearest_image(a.packing.position - b.packing.position, a.packing.box)
    largest = np.abs(apart / a.packing.box.edges).max()
    return largest, angle_between(a.quaternion, b.quaternion).max()


# --- packings ------------------------------------------------------------------------------------


def rods(position, angle, half_length, radius, edges, **fields):
    """Packing of the plane from arrays; one radius and half length may stand for all."""
    n = len(position)
    A, R = np.broadcast_to(half_length, n), np.broadcast_to(radius, n)
    box = Box(lo=-0.5 * np.asarray(edges, float), edges=np.asarray(edges, float))
    arrays = {
        "position": np.asarray(position, float),
        "orientation": np.broadcast_to(angle, n),
        "diameters": np.column_stack([2 * (A + R), 2 * R, 2 * R]),
        "species": np.ones(n, int),
        "id": np.arange(1, n + 1),
        "box": box,
    }
    return Packing(**(arrays | fields))


def rods_3d(position, quaternion, half_length, radius, edges, **fields):
    n = len(position)
    q = np.broadcast_to(quaternion, (n, 4))
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    flat = rods(np.zeros((n, 2)), 0.0, half_length, radius, [1.0, 1.0])
    box = Box(lo=-0.5 * np.asarray(edges, float), edges=np.asarray(edges, float))
    arrays = {"position": np.asarray(position, float), "orientation": q, "box": box}
    return flat.with_(**({"image": np.empty((0, 0), int)} | arrays | fields))


def quaternion_product(p, q):
    (a, b, c, d), (e, f, g, h) = np.moveaxis(p, -1, 0), np.moveaxis(q, -1, 0)
    return np.stack(
        [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ],
        axis=-1,
    )


def rotation_by(vectors):
    """Quaternions of rotations by the angle |v| about v."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), np.sinc(angle / 2 / np.pi) * vectors / 2], axis=-1)


def turned(packing, vectors):
    """Every particle turned: by angles (N,) in the plane, by rotation vectors (N, 3) in space."""
    if packing.dimension == 2:
        return packing.with_(orientation=packing.orientation + vectors)
    return packing.with_(orientation=quaternion_product(rotation_by(vectors), packing.orientation))


def kicked(packing, amplitude, seed):
    """Every particle moved at random by up to this many radii; tips move no farther by turning.

    Drawn again, and smaller, while spines cross.
    """
    rng = np.random.default_rng(seed)
    shape = (packing.n,) if packing.dimension == 2 else (packing.n, 3)
    for attempt in range(20):
        step = amplitude * 0.8**attempt * packing.radius
        shift = step[:, None] * rng.uniform(-1, 1, (packing.n, packing.dimension))
        reach = packing.diameters[:, 0] / 2
        angle = (rng.uniform(-1, 1, shape).T * step / reach).T
        result = turned(packing.with_(position=packing.position + shift), angle)
        with suppress(ValueError):
            contacts.find_contacts(result, sides=1)
            return result
    raise AssertionError


def compressed(packing, phi, speed=0.03, dt=0.1):
    """Driven by fix overdamped/affine to a packing fraction; walls move at about this speed."""
    with tempfile.TemporaryDirectory() as folder, loaded(packing, folder, sides="two") as session:
        session.commands(f"timestep {dt}")
        reached = packing.phi
        while reached < phi * (1 - 1e-9):
            strain = np.log(min(phi / reached, 1.3)) / packing.dimension
            steps = np.ceil(strain * session.lmp.extract_box()[1][0] / (speed * dt))
            session.commands(f"""
                fix compress all overdamped/affine drag 1.0 compress {strain / (steps * dt)}
                run {steps:.0f} post no
                unfix compress""")
            reached = state_of(session).packing.phi
        return state_of(session).packing


def squeezed(packing, factor):
    """Positions and box shrunk at once."""
    box = Box(lo=factor * packing.box.lo, edges=factor * packing.box.edges)
    return packing.with_(position=factor * packing.position, box=box)


def relaxed(packing, steps, dt=0.1, sides="two"):
    """Left to itself for a while."""
    with tempfile.TemporaryDirectory() as folder, loaded(packing, folder, sides=sides) as session:
        session.commands(f"""
            fix relax all overdamped/affine drag 1.0 compress 0.0
            timestep {dt}
            run {steps}""")
        return state_of(session).packing


def on_grid(packing, bits=32):
    """Positions and box rounded to multiples of 2^-bits: periodic images are then exact."""
    unit = 2.0**-bits
    edges = 2 * unit * np.round(packing.box.edges / (2 * unit))
    position = unit * np.round(packing.position / unit)
    return packing.with_(position=position, box=Box(lo=-edges / 2, edges=edges))


def with_odd_ids(packing, seed):
    """IDs shuffled, with gaps."""
    rng = np.random.default_rng(seed)
    return packing.with_(id=rng.permutation(3 * packing.n)[: packing.n] + 1)


def wrapped(packing):
    """Positions in the box, image counts to match."""
    turns = np.floor((packing.position - packing.box.lo) / packing.box.edges).astype(int)
    return packing.with_(
        position=packing.position - turns * packing.box.edges, image=packing.image + turns
    )


def moved(packing, fraction):
    """All positions shifted by these fractions of the box and wrapped, image counts forgotten."""
    shift = np.asarray(fraction)[: packing.dimension] * packing.box.edges
    shifted = wrapped(packing.with_(position=packing.position + shift))
    return shifted.with_(image=np.zeros_like(shifted.image))


def scattered(half_length, radius, species, dimension, rng):
    """Turned at random on a grid as wide as the longest particle, in random order."""
    n = len(radius)
    order = rng.permutation(n)
    A, R = np.asarray(half_length)[order], np.asarray(radius)[order]
    side, cell = int(np.ceil(n ** (1 / dimension))), 2 * (A + R).max()
    sites = rng.permutation(side**dimension)[:n]
    cells = np.stack(np.unravel_index(sites, (side,) * dimension), axis=1)
    position, edges = cell * (cells + 0.5 - side / 2), [side * cell] * dimension
    if dimension == 2:
        angle = rng.uniform(-np.pi, np.pi, n)
        return rods(position, angle, A, R, edges, species=np.asarray(species)[order])
    quaternion = rng.normal(size=(n, 4))
    return rods_3d(position, quaternion, A, R, edges, species=np.asarray(species)[order])


@functools.cache
def dense(dimension=2, alpha=4.0, n=48, phi=0.95, seed=1, kick=0.05, speed=0.03):
    """Far above jamming and kicked off every kink of the energy: contacts of all classes."""
    species = 1 + np.arange(n) % 2
    radius = np.array([0.5, 0.7])[species - 1]
    rng = np.random.default_rng(seed)
    start = scattered(alpha * radius, radius, species, dimension, rng)
    return wrapped(on_grid(kicked(compressed(start, phi, speed), kick, seed)))


@functools.cache
def dense_mixture(dimension=2, n=48, phi=0.95, seed=1, kick=0.05):
    """As `dense`, of discs (spheres) and of rods with alpha up to 5 and sizes up to a factor 3."""
    rng = np.random.default_rng(seed)
    radius = 0.5 * rng.uniform(1, 3, n)
    half_length = radius * rng.uniform(0, 5, n) * (np.arange(n) % 3 > 0)
    start = scattered(half_length, radius, 1 + np.arange(n) % 2, dimension, rng)
    return wrapped(on_grid(kicked(compressed(start, phi), kick, seed)))


def tiny_box():
    """Two rods that touch their own images and several images of each other."""
    return rods([[0.0, 0.0], [0.25, 1.0]], [0.0, 0.02], 1.5, [0.6, 0.5], [4.0, 2.0])
