"""Regular packings."""

import numpy as np
from scenes import make


def discs(position, edges, radius=0.5):
    packing = make(position, 0.0, half_length=0.0, edges=edges)
    return packing.with_(diameters=np.full((packing.n, 3), 2 * radius))
