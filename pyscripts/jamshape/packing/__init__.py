"""The state of a packing, its poses in extended precision, and rotations."""

from jamshape.packing.packing import Box, Packing
from jamshape.packing.rotation import UNIT_QUATERNION_TOLERANCE, angle_from_quaternion, body_axes
from jamshape.packing.state import State

__all__ = [
    "UNIT_QUATERNION_TOLERANCE",
    "Box",
    "Packing",
    "State",
    "angle_from_quaternion",
    "body_axes",
]
