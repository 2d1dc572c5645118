"""The state of a packing, and rotations."""

from jamshape.packing.packing import (
    Box,
    FloatArray,
    IntArray,
    LongArray,
    Packing,
    SHAPE_STYLES,
    UNIT_QUATERNION_TOLERANCE,
    angle_from_quaternion,
    body_axes,
    guess_shape_style,
)

__all__ = [
    "Box",
    "FloatArray",
    "IntArray",
    "LongArray",
    "Packing",
    "SHAPE_STYLES",
    "UNIT_QUATERNION_TOLERANCE",
    "angle_from_quaternion",
    "body_axes",
    "guess_shape_style",
]
