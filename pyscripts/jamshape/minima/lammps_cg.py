"""LAMMPS's own conjugate gradients (`min_style cg`, Polak-Ribiere) as one of the minimisers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jamshape.lammps.session import Session
from jamshape.landscape import State

if TYPE_CHECKING:
    from jamshape.landscape import Landscape
    from jamshape.minima.minimise import Descent, Outcome
from jamshape.arrays import IntArray

# Iterations between two looks at the residual, and how many looks without one end it.
_ITERATIONS = 100
_IDLE = 3

# LAMMPS stops when the energy changes by less than 1e-8 of (the energy + 1e-8): in units of k_e that
# would be far above the energy of a packing near jamming.
_ENERGY = 1e3


def descend(descent: Descent) -> Outcome | None:
    """Minimise in a LAMMPS session of its own, in doubles; None if LAMMPS goes on no more."""
    landscape = descent.landscape
    idle = 0
    with Session() as session:
        _set_up(session, landscape, descent.state, _ENERGY / descent.evaluation.energy)
        while not (outcome := descent.outcome()):
            begin = session.step
            session.commands(f"minimize 0 1e-300 {_ITERATIONS} {100 * _ITERATIONS}")
            landscape.evaluations += session.step - begin  # at least: LAMMPS counts line searches
            state = State.of(session.packing())
            descent.move_to(state, landscape.evaluate(state, extended=False))
            idle = idle + 1 if session.step - begin < _ITERATIONS else 0
            if idle == _IDLE:
                return None
    return outcome


def _set_up(session: Session, landscape: Landscape, state: State, factor: float) -> None:
    packing = state.packing(landscape.particles)
    types, pair_style = _types_and_pair_style(landscape, landscape.k_e * factor)
    # Numbered so that they come back in order.
    session.load(packing.with_(id=1 + np.arange(packing.n), species=types))
    session.commands(f"""
        {pair_style}
        {session.neighbours()}
        min_style cg
        min_modify dmax {0.1 * landscape.length!r}
        thermo_modify lost error
    """)


def _types_and_pair_style(landscape: Landscape, energy: float) -> tuple[IntArray, str]:
    """Give each exponent a type: exponents of superellipsoids are per type in LAMMPS."""
    packing = landscape.particles
    if packing.shape_style == "spherocylinder":
        sides = ("one", "two")[landscape.sides - 1]
        style = f"pair_style spherocylinder/harmonic sides {sides}\npair_coeff * * {energy!r}"
        return packing.species, style
    exponents, kind = np.unique(packing.exponent, return_inverse=True)
    lines = ["pair_style superellipsoid/harmonic", f"pair_coeff * * {energy!r}"]
    lines += [f"pair_coeff {k} {k} {energy!r} {float(p)!r}" for k, p in enumerate(exponents, 1)]
    return 1 + kind, "\n".join(lines)
