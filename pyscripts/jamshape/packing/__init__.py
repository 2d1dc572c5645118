"""The state of a packing, its poses in extended precision, and rotations."""

from jamshape.packing.box import Box, Lengths, affine_change, cuboid_around
from jamshape.packing.packing import Packing
from jamshape.packing.rotation import (
    UNIT_QUATERNION_TOLERANCE,
    angle_from_quaternion,
    body_axes,
    rate_of_vector,
    spin_of_vector,
    turned,
)
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
    "rate_of_vector",
    "spin_of_vector",
    "turned",
]
