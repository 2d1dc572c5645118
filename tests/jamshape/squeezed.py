"""Packings just below jamming."""

from functools import cache

import numpy as np

from jamshape.landscape import Landscape, State
from jamshape.minima import (
    Stop,
    minimise,
)
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles
from methods.lbfgs import lbfgs


@cache
def squeezed(n, alpha, phi, seed=1, style="spherocylinder"):
    """A random packing, brought to phi in steps, each followed by a rough minimisation."""
    packing = random_packing(n, 0.4, seed, Particles.of(style, alpha=alpha))
    landscape, state = Landscape(packing), State.of(packing)
    while (now := state.packing(packing).phi) < phi * (1 - 1e-12):
        state = state.strained(max(-0.01, np.sqrt(now / phi) - 1))
        rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=200)
        state = minimise(landscape, state, lbfgs, rough).state
    return packing, state
