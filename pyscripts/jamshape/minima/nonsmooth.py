"""Minima on kinks of the energy, where a convex combination of one-sided gradients vanishes.

The bond at the farther end of two nearly parallel rods passes from one tip to another where both are level
(`jamshape.vibration.kinks`). Its energy is the larger of two there, and its force jumps. A packing may come to rest
on such a kink: forces on both sides push towards it, so neither side is at rest, yet no motion lowers the energy.
That is the case if some convex combination of the gradients around the kink is zero: 0 is in the Clarke
subdifferential. Stages of a slow flow hold a state on kinks, too: so the state is relaxed by implicit steps of its
overdamped motion, longer and longer ones, until it is at rest. This is the proximal point method (R. T. Rockafellar,
SIAM J. Control Optim. 14, 877 (1976)). Independent of the shape; needs no LAMMPS.
"""

from __future__ import annotations

import math

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.landscape import CrossingError
from jamshape.landscape.local_energy_model import (
    LocalEnergyModel,
    Solution,
    Stage,
    StageKinks,
    Units,
)
from jamshape.minima.descent import Descent, Outcome

# Drag coefficient over the time of the first step, of the longest and of the shortest one, over the stiffness of a bond.
_FIRST, _LEAST, _MOST = 1e-3, 1e-12, 1.0

# Factors of it after a step, and after one without a solution.
_LONGER, _SHORTER = 0.25, 8.0

# Largest number of steps: 5 to 60 bring rods to rest that are at least 1e-5 above jamming.
_STEPS = 200

_ACCURACY = 0.1  # of steps over the tolerance

_RISE = 1e-9  # an energy that rises by more than this fraction is that of another minimum


def relax(descent: Descent) -> Outcome | None:
    """Relax a state at which a minimisation stalled, along kinks of the energy and onto them.

    Parameters
    ----------
    descent : Descent
        It moves along. At rest on a kink its gradient is the convex combination.

    Returns
    -------
    Outcome or None
        None if neither rest nor another end is reached.
    """
    landscape, drag = descent.landscape, _FIRST
    local_model, kinks = LocalEnergyModel(landscape, descent.state), StageKinks()
    for _ in range(_STEPS):
        if descent.outcome() or drag > _MOST:
            break
        pull = np.full(landscape.size, drag * _stiffness(descent))
        step = _step(descent, local_model, pull, kinks)
        if step is None:
            drag, kinks = _SHORTER * drag, StageKinks()
            continue
        drag, kinks = max(_LONGER * drag, _LEAST), step.kinks
        on_kinks = local_model.on_kinks(step.x, step.evaluation, kinks)
        local_model.move_to(local_model.at(step.x, 0.0))
        descent.move_to(local_model.base, on_kinks)
    outcome = descent.outcome()
    if outcome is Outcome.CONVERGED:
        return Outcome.KINK if len(kinks) else outcome
    descent.move_to(descent.state, landscape.evaluate(descent.state))  # with the forces of its side
    return outcome


def _stiffness(descent: Descent) -> float:
    """Return the stiffness of a typical bond."""
    landscape = descent.landscape
    return landscape.stiffness_at(descent.evaluation.bond_force) / landscape.length**2


def _step(
    descent: Descent, local_model: LocalEnergyModel, pull: FloatArray, kinks: StageKinks
) -> Solution | None:
    """Solve an implicit step, and evaluate its end; None without a solution."""
    accuracy, still = _ACCURACY * descent.stop.tolerance, np.zeros_like(pull)
    # Doubles do not tell on which side of a kink a point close to it is.
    stage = Stage(pull, still, (still, still), extended=True)
    try:
        found = local_model.solve(stage, kinks, _units(descent), accuracy)
        there = local_model.evaluate(found.x, 0.0, extended=True)
    except (CrossingError, RuntimeError):  # or second derivatives that jump, as for flat faces
        return None
    rises = there.energy > (1 + _RISE) * descent.evaluation.energy
    return found._replace(evaluation=there) if found.solved and not rises else None


def _units(descent: Descent) -> Units:
    """Return the units of errors of a step."""
    force, size = descent.evaluation.bond_force, descent.landscape.length
    overlap, n = force / _stiffness(descent), descent.landscape.particles.n
    energy = max(descent.evaluation.n_bonds, n) * force * overlap
    return Units(force, energy, math.sqrt(overlap * size), n)
