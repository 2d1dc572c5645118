"""Contacts of individual pairs of bodies from `lammps_plugin/contact/`, for studies of error and cost.

Bodies are C-contiguous rows: centre, unit axis, half length and radius of spherocylinders; centre,
angle or quaternion, semi-axes and exponent of superellipsoids. Packings use the classes of each shape instead.
"""

from jamshape._contact import (
    spherocylinder_contacts,
    superellipsoid_contacts,
    superellipsoid_overlap,
    superellipsoid_scales,
)

__all__ = [
    "spherocylinder_contacts",
    "superellipsoid_contacts",
    "superellipsoid_overlap",
    "superellipsoid_scales",
]
