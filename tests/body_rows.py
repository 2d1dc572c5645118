"""Rows of bodies as the probes of the compiled module take them."""

import numpy as np


def superellipsoid_rows(packing):
    """Centre, angle or quaternion, semi-axes, exponent."""
    axes = packing.diameters[:, : packing.dimension] / 2
    return np.column_stack([packing.position, packing.orientation, axes, packing.exponent])
