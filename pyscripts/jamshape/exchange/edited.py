"""Detection of changes that another program made in our GSD frames, which override our doubles.

Other programs know the single-precision numbers of a frame and neither read nor change logged data. So if the two
differ by more than rounding to single precision, the frame was changed, and the doubles are outdated.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from jamshape.arrays import BoolArray, FloatArray
from jamshape.packing import Box, Packing, angle_from_quaternion

# Relative, in single precision; a program may have converted units back and forth.
_ROUNDING = 4 * 2.0**-24


def as_edited(packing: Packing, ours: Any, frame: Any) -> Packing:
    """Apply the changes of another program to a packing.

    Parameters
    ----------
    packing : Packing
        Packing from the doubles of the frame.
    ours : gsd.hoomd.Frame
        The frame that `write_gsd` writes for that packing.
    frame : gsd.hoomd.Frame
        The frame as it was read.

    Returns
    -------
    Packing
        The same object if nothing was changed.

    Raises
    ------
    ValueError
        If numbers or kinds of particles were changed, which the frame does not fully describe.
    """
    _require_same_particles(ours, frame)
    changes: dict[str, Any] = {}
    scale = np.abs(ours.configuration.box[:3]).max()
    box = np.asarray(frame.configuration.box, np.float64)
    if not _agrees(box[:3], ours.configuration.box[:3], scale) or not _agrees(
        box[3:], ours.configuration.box[3:], 1.0
    ):
        changes["box"] = _box(box, packing.dimension)
    changes |= _moved(packing, ours, frame, changes.get("box", packing.box))
    turned = _turned(ours, frame)
    if turned.any():
        changes["orientation"] = _orientation(packing, frame, turned)
    if not changes:
        return packing
    return packing.with_(**_with_rests(packing, changes))


def _require_same_particles(ours: Any, frame: Any) -> None:
    """Refuse other types, from which particles cannot be fully reconstructed."""
    if frame.particles.N != ours.particles.N:
        found, expected = frame.particles.N, ours.particles.N
        msg = (
            f"holds {found} particles but doubles of {expected}: another program has added or removed"
            " some, expected the particles that write_gsd wrote"
        )
        raise ValueError(msg)
    names = [[x.particles.types[k] for k in x.particles.typeid] for x in (frame, ours)]
    shapes = [_shapes(x) for x in (frame, ours)]
    if names[0] != names[1] or (any(shapes[0]) and shapes[0] != shapes[1]):
        msg = (
            "another program has changed types of particles or their shapes, expected those that"
            " write_gsd wrote; change them in jamshape"
        )
        raise ValueError(msg)


def _shapes(frame: Any) -> list[Any]:
    known = frame.particles.type_shapes or [{}] * len(frame.particles.types)
    return [known[k] for k in frame.particles.typeid]


def _agrees(found: Any, expected: Any, scale: float) -> bool:
    difference = np.abs(np.asarray(found, np.float64) - np.asarray(expected, np.float32))
    return bool((difference <= _ROUNDING * scale).all())


def _box(sizes: FloatArray, dimension: int) -> Box:
    """Make the box around 0 from edges and tilt factors."""
    factors = np.eye(3)
    factors[np.triu_indices(3, 1)] = sizes[3:]
    matrix = (factors * sizes[:3])[:dimension, :dimension]
    return Box.of(-matrix.sum(axis=1) / 2, matrix)


def _moved(packing: Packing, ours: Any, frame: Any, box: Box) -> dict[str, Any]:
    """Return changed positions and images; a particle in another image of the box has not moved."""
    D = packing.dimension
    found, before = (np.asarray(x.particles.position, np.float64)[:, :D] for x in (frame, ours))
    turns = np.rint(box.fractions(found - before))
    left = found - before - box.vectors(turns)
    scale = float(box.edges.max()) / 2
    is_moved: BoolArray = np.array(box is not packing.box) | (np.abs(left) > _ROUNDING * scale).any(
        axis=1
    )
    changes: dict[str, Any] = {}
    if is_moved.any():
        changes["position"] = np.where(is_moved[:, None], found + box.center, packing.position)
    counted = np.asarray(frame.particles.image)[:, :D]
    is_counted = (counted != np.asarray(ours.particles.image)[:, :D]) | (turns != 0)
    if is_counted.any() or is_moved.any():
        wrapped = np.asarray(ours.particles.image)[:, :D] - packing.image
        kept = counted + turns.astype(np.int64) - wrapped
        changes["image"] = np.where(is_moved[:, None], counted, kept)
    return changes


def _turned(ours: Any, frame: Any) -> BoolArray:
    """(N,) whether each particle was rotated; q and -q are one rotation."""
    found, before = (np.asarray(x.particles.orientation, np.float64) for x in (frame, ours))
    sign = np.where((found * before).sum(axis=1, keepdims=True) < 0, -1, 1)
    return np.asarray((np.abs(found - sign * before) > _ROUNDING).any(axis=1))


def _orientation(packing: Packing, frame: Any, turned: BoolArray) -> FloatArray:
    found = np.asarray(frame.particles.orientation, np.float64)
    if packing.dimension == 2:
        return np.where(turned, angle_from_quaternion(found), packing.orientation)
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(turned[:, None], found, packing.orientation)


def _with_rests(packing: Packing, changes: dict[str, Any]) -> dict[str, Any]:
    """Keep the low parts of unchanged numbers."""
    for name in ("position", "orientation"):
        if name in changes:
            stays = changes[name] == getattr(packing, name)
            changes[f"{name}_rest"] = np.where(stays, getattr(packing, f"{name}_rest"), 0.0)
    return changes
