"""Instantaneous rotation rates of particles in a sheared packing, by the host and by contact torques."""

from __future__ import annotations

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.flow.host import Host
from jamshape.flow.implicit import drag_coefficients
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.shapes.shape import Interaction


def rotation_rates(
    packing: Packing, host: Host, law: Interaction | None = None, k_d: float = 1.0
) -> FloatArray:
    """Return the angular velocity of each particle of a packing in the plane.

    Parameters
    ----------
    packing : Packing
    host : Host
    law : Interaction, optional
        By default that of the packing.
    k_d : float, [energy time / length^4]

    Returns
    -------
    (N,) array of float64, [1/time]
        dtheta/dt = w + tau / (k_d A I), with host rotation w (Marschall & Teitel 2019, Phys. Rev. E 100, 032906).

    Raises
    ------
    ValueError
        If the packing is not in two dimensions.
    """
    landscape = Landscape(packing if law is None else packing.with_(law=law))
    velocity = -landscape.evaluate(State.of(packing)).gradient / drag_coefficients(landscape, k_d)
    _, turns = landscape.motion(velocity)
    angle = np.asarray(packing.orientation, np.float64)
    return np.asarray((host.spin(landscape.bodies, angle[:, None]) + turns)[:, 0])
