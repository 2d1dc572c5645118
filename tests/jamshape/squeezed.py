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
    return _brought_to(phi, random_packing(n, 0.4, seed, Particles.of(style, alpha=alpha)), lbfgs)


@cache
def quickly_squeezed(n, alpha, phi, seed=1):
    """Another one than by `squeezed`, in a tenth of the time: minimisers in Python are slow."""
    start = random_packing(n, 0.4, seed, Particles.of("spherocylinder", alpha=alpha))
    return _brought_to(phi, start, "auto")


def squeezed_at_once(n, particles, dimension):
    """Far beyond jamming in one step; the landscape, and a state away from its minimum."""
    phi = {2: 0.9, 3: 0.75}[dimension]
    packing = random_packing(n, 0.25, 1, particles, dimension=dimension)
    strain = (0.25 / phi) ** (1 / dimension) - 1
    return Landscape(packing), State.of(packing).strained(strain)


def _brought_to(phi, packing, method):
    landscape, state = Landscape(packing), State.of(packing)
    while (now := state.packing(packing).phi) < phi * (1 - 1e-12):
        state = state.strained(max(-0.01, np.sqrt(now / phi) - 1))
        rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=200)
        state = minimise(landscape, state, method, rough).state
    return packing, state
