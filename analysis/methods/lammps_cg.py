"""LAMMPS's own conjugate gradients (`min_style cg`, Polak-Ribiere) to compare minimisers with."""

from __future__ import annotations

import numpy as np

from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.minima import Descent, Outcome
from jamshape.packing import State

_ITERATIONS = 100  # between two checks of the residual
_IDLE = 3  # checks in a row without gain that end it

# LAMMPS stops when the energy changes by less than 1e-8 of (the energy + 1e-8): in units of k_e that
# would be far above the energy of a packing near jamming.
_ENERGY = 1e3


def lammps_cg(descent: Descent) -> Outcome:
    """Minimise in a LAMMPS session of its own, in doubles; a method of `jamshape.minima.minimise`."""
    landscape = descent.landscape
    idle = 0
    with Session() as session:
        _set_up(session, landscape, descent.state, _ENERGY / descent.evaluation.energy)
        while not (outcome := descent.outcome()):
            begin = session.step
            session.commands(f"minimize 0 1e-300 {_ITERATIONS} {100 * _ITERATIONS}")
            landscape.evaluations += session.step - begin  # at least: LAMMPS counts line searches
            state = State.of(session.packing())
            before = descent.evaluation.energy
            descent.move_to(state, landscape.evaluate(state, extended=False))
            # LAMMPS stops early, or oscillates.
            is_idle = session.step - begin < _ITERATIONS or descent.evaluation.energy >= before
            idle = idle + 1 if is_idle else 0
            if idle == _IDLE:
                return Outcome.STALLED
    return outcome


def _set_up(session: Session, landscape: Landscape, state: State, factor: float) -> None:
    packing = state.packing(landscape.particles)
    law = packing.law.but(np.multiply(landscape.k_e, factor), landscape.sides)
    # Numbered so that they come back in order.
    session.load(packing.with_(id=1 + np.arange(packing.n)))
    session.interact(law)
    session.commands(f"""
        {session.neighbours()}
        min_style cg
        min_modify dmax {0.1 * landscape.length!r}
        thermo_modify lost error
    """)
