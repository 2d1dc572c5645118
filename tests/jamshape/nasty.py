"""Packings whose numbers have no short decimals, and how to compare them."""

import numpy as np

from jamshape.packing import Box, Packing

NASTY = [0.1 + 0.2, 1 / 3, -0.0, np.finfo(float).tiny, np.nextafter(1, 2), -np.finfo(float).max]


ARRAYS = ("position", "orientation", "diameters", "species", "id", "image")


def nasty_packing(dimension, **changes):
    """Six particles, two of them discs, with doubles that short decimals do not hold."""
    rng = np.random.default_rng(dimension)
    n = len(NASTY)
    half_length, radius = rng.random(n) * (np.arange(n) > 1), 1 / rng.uniform(1, 2, n)
    position = rng.normal(size=(n, dimension))
    position[:, 0] = NASTY
    quaternion = rng.normal(size=(n, 4))
    fields = {
        "position": position,
        "orientation": rng.uniform(-np.pi, np.pi, n)
        if dimension == 2
        else quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
        "diameters": np.column_stack([2 * (half_length + radius), 2 * radius, 2 * radius]),
        "species": np.arange(n) % 2 + 1,
        "id": rng.permutation(n) + 1,
        "image": rng.integers(-3, 4, (n, dimension)),
        "box": Box(lo=np.full(dimension, -1 / 3), edges=np.full(dimension, np.nextafter(7, 8))),
        "step": 12345678901,
        "time": 1 / 7,
    }
    return Packing(**(fields | changes))


def assert_identical(a, b):
    """Compare bit for bit, so that -0.0 differs from 0.0."""
    for name in ARRAYS:
        x, y = getattr(a, name), getattr(b, name)
        assert (x.dtype, x.shape, x.tobytes()) == (y.dtype, y.shape, y.tobytes()), name
    assert a.box.lo.tobytes() == b.box.lo.tobytes()
    assert a.box.edges.tobytes() == b.box.edges.tobytes()
    assert a.box.tilt.tobytes() == b.box.tilt.tobytes()
    assert (a.shape_style, a.law, a.step, a.time) == (b.shape_style, b.law, b.step, b.time)


def tilted_box(dimension):
    """A box whose tilts have no short decimals."""
    tilt = np.array([1 / 3, -2 / 7, np.nextafter(3, 4)])
    return Box(np.full(dimension, -1 / 3), np.full(dimension, 23 / 3), tilt[: 2 * dimension - 3])


def with_rests(dimension, **changes):
    """A packing whose poses are known to more digits than doubles hold."""
    packing = nasty_packing(dimension, **changes)
    packing = packing.with_(position=packing.position.clip(-9, 9))
    finer = [
        x + np.longdouble(1) / 3 * np.spacing(np.longdouble(1) * 1e-3) for x in packing.poses()
    ]
    finer = [x + np.spacing(np.abs(x).astype(float)) / np.longdouble(7) for x in finer]
    finer[2] = np.where(packing.box.matrix, finer[2], 0)
    return packing.with_poses(*finer)
