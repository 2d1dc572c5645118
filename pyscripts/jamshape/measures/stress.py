"""Shear stress from a pressure tensor, by the names of `compute packing`."""

from __future__ import annotations

import math
from typing import NamedTuple

from jamshape.arrays import FloatArray


class ShearStress(NamedTuple):
    """Components in the plane of x and y, [energy / length^D] except mu."""

    p_xy: float
    normal_difference: float
    """p_xx - p_yy."""
    sigma: float
    """Half the difference of the eigenvalues in the plane."""
    mu: float
    """sigma over the pressure; 0 without pressure."""

    @classmethod
    def of(cls, tensor: FloatArray) -> ShearStress:
        """Derive the components from a pressure tensor (D, D).

        Examples
        --------
        >>> import numpy as np
        >>> ShearStress.of(np.array([[2.0, -0.4], [-0.4, 1.4]]))
        ShearStress(p_xy=-0.4, normal_difference=0.6000000000000001, sigma=0.5, mu=0.29411764705882354)
        """
        p_xy, difference = float(tensor[0, 1]), float(tensor[0, 0] - tensor[1, 1])
        sigma, pressure = math.hypot(difference / 2, p_xy), float(tensor.trace()) / len(tensor)
        return cls(p_xy, difference, sigma, sigma / pressure if pressure > 0 else 0.0)
