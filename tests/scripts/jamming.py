"""Small jammed packings, without LAMMPS, and their files."""

from jamshape.landscape import Landscape, State
from jamshape.measures.minimum import write_minimum
from jamshape.minima import Stop, minimise
from jamshape.minima.target import Target, find
from jamshape.protocols.random_start import random_packing
from methods.lbfgs import lbfgs


def jam(particles, n, phi, u0=1e-12, dimension=2, seed=1):
    """Squeeze a random start to phi, and lead it to an energy density."""
    packing = random_packing(n, 0.4 if dimension == 2 else 0.2, seed, particles, dimension)
    landscape, state = Landscape(packing), State.of(packing)
    rough = Stop(tolerance=1e-2, lowest=1e-10, evaluations=200)
    while state.packing(packing).phi < phi:
        state = minimise(landscape, state.strained(-0.01), lbfgs, rough).state
    return landscape, find(landscape, state, Target(u0))


def write_jammed(path, particles, n, phi, seed=1, **attributes):
    """Write such a packing as make_packing.py does; return its landscape and its minimum."""
    u0 = attributes.setdefault("u0", 1e-12)
    landscape, minimum = jam(particles, n, phi, u0, seed=seed)
    known = dict(particles.told) | {"n": n, "seed": seed} | attributes
    write_minimum(path, landscape, minimum, known)
    return landscape, minimum
