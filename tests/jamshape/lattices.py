"""Regular packings."""

from dataclasses import replace
import numpy as np
import pytest
from small_packings import SMALL, jammed, matrix_of
from scenes import make, scaled
from pressed import PRESSED, pressed_named
from jamshape.contacts import ContactKind
from jamshape.landscape import Landscape, State
from jamshape.packing import Box
from jamshape.vibration.hessian import (
    LARGEST_RESIDUAL,
    NotAtMinimumError,
    Scope,
    dynamical_matrix,
    matrix_at,
)
from jamshape.vibration.spectrum import spectrum


def discs(position, edges, radius=0.5):
    packing = make(position, 0.0, half_length=0.0, edges=edges)
    return packing.with_(diameters=np.full((packing.n, 3), 2 * radius))
