"""Pairs of bodies one by one, as `lammps_plugin/contact/` sees them: for studies of its errors and of its cost.

Bodies are C-contiguous rows: of spherocylinders centre, unit axis, half length and radius; of superellipsoids centre,
angle or quaternion, semi-axes and exponent. Packings are evaluated by the classes of each shape instead.
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
