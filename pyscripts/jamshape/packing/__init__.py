"""The state of a packing, and rotations."""

from jamshape.packing.packing import (
    SHAPE_STYLES,
    UNIT_QUATERNION_TOLERANCE,
    Box,
    FloatArray,
    IntArray,
    LongArray,
    Packing,
    angle_from_quaternion,
    body_axes,
    guess_shape_style,
)

__all__ = [
    "SHAPE_STYLES",
    "UNIT_QUATERNION_TOLERANCE",
    "Box",
    "FloatArray",
    "IntArray",
    "LongArray",
    "Packing",
    "angle_from_quaternion",
    "body_axes",
    "guess_shape_style",
]


__all__ = [
    "SHAPE_STYLES",
    "UNIT_QUATERNION_TOLERANCE",
    "Box",
    "Packing",
    "angle_from_quaternion",
    "body_axes",
    "guess_shape_style",
]
