"""Random starts."""

import numpy as np
from extreme import case, extreme
from extreme_rods import RODS, sizes

from jamshape.landscape import Landscape, State
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

N = 12


@extreme("energy; error of phi", [
    case(f"random start: {D}D, alpha {alpha:g}, size ratio {ratio:g}", alpha, ratio, phi, D)
    for alpha, ratio, phi, D in (
        (1e-6, 1.4, 0.4, 2), (1e-6, 10.0, 0.4, 2), (100.0, 1.4, 0.05, 2), (1.0, 10.0, 0.3, 3),
        (10.0, 1.4, 0.05, 3), (4.0, 1e6, 0.2, 2),
    )
], 1e-14)  # fmt: skip
def test_start(alpha, size_ratio, phi, dimension):
    """As many small as big ones, one by one: their sizes may differ by more than those of options."""
    R = 0.5 * np.repeat([1.0, size_ratio], N // 2)
    particles = Particles.given(RODS, sizes(alpha * R, R), species=np.repeat([1, 2], N // 2))
    packing = random_packing(N, phi, 1, particles, dimension)
    energy = Landscape(packing).evaluate(State.of(packing)).energy
    return max(energy, abs(packing.phi / phi - 1))


@extreme("", [
    case(f"random start: alpha {alpha:g} at phi {phi:g}", alpha, phi)
    for alpha, phi in ((0.0, 0.99), (4.0, 0.9), (100.0, 0.5))
], r"(stalled at phi|no direction found).*start at phi")  # fmt: skip
def test_too_dense(alpha, phi):
    """Beyond what random insertion reaches."""
    random_packing(N, phi, 1, Particles.of(RODS, alpha=alpha))
