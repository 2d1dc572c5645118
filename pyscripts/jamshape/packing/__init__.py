"""The state of a packing, its poses in extended precision, and rotations."""

from jamshape.packing.box import Box, Lengths, affine_change, cuboid_around
from jamshape.packing.packing import Packing
from jamshape.packing.rotation import UNIT_QUATERNION_TOLERANCE, angle_from_quaternion, body_axes
from jamshape.packing.state import State

__all__ = [
    "UNIT_QUATERNION_TOLERANCE",
    "Box",
    "Lengths",
    "Packing",
    "State",
    "affine_change",
    "angle_from_quaternion",
    "body_axes",
    "cuboid_around",
]
