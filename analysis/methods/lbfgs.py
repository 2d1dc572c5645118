"""SciPy's L-BFGS, in doubles: a minimiser to compare with, and rough starts of tests."""

from __future__ import annotations

import contextlib
import math

import numpy as np
import scipy.optimize

from jamshape.arrays import FloatArray
from jamshape.contacts import CrossingError
from jamshape.minima.descent import Descent, Outcome

# Evaluations without gain that count as a stall; the number needed to unjam a packing grows with it.
_PATIENCE = 1000
_PATIENCE_PER_PARTICLE = 4

# SciPy is restarted when it gives up, unless this number of restarts in a row needed few evaluations.
_STUCK = 3
_SOON = 30  # evaluations that count as few


class _LeaveError(Exception):
    """Ends SciPy's minimiser from within."""


def lbfgs(descent: Descent) -> Outcome:
    """Minimise displacements from the present state; a method of `jamshape.minima.minimise`."""
    particles = descent.landscape.particles
    descent.be_patient(max(_PATIENCE, _PATIENCE_PER_PARTICLE * particles.n))
    # Its first step has unit length in its own coordinates.
    unit = 0.01 * float(descent.landscape.inner_radius.min()) * math.sqrt(particles.n)
    stuck = 0
    while not (outcome := descent.outcome()) and descent.residual > 0 and stuck < _STUCK:
        evaluations = descent.evaluations
        with contextlib.suppress(_LeaveError):
            scipy.optimize.minimize(
                _Objective(descent, unit),
                np.zeros(descent.landscape.size),
                jac=True,
                method="L-BFGS-B",
                options={"maxiter": 10**8, "maxfun": 10**8, "maxcor": 20, "ftol": 0.0, "gtol": 0.0},
            )
        # It gives up when its line search does, at kinks or in rounding: restart from there.
        stuck = stuck + 1 if descent.evaluations - evaluations < _SOON else 0
        unit *= 0.1 if stuck else 1.0
    return outcome or Outcome.STALLED


class _Objective:
    """The energy for SciPy: of displacements in units, relative to the energy at the start."""

    def __init__(self, descent: Descent, unit: float) -> None:
        self.descent, self.unit = descent, unit
        self.base, self.scale = descent.state, descent.evaluation.energy

    def __call__(self, x: FloatArray) -> tuple[float, FloatArray]:
        descent = self.descent
        state = descent.landscape.displaced(self.base, self.unit * x)
        try:
            found = descent.landscape.evaluate(state, extended=False)
        except CrossingError:
            raise _LeaveError from None
        if found.energy <= descent.evaluation.energy:
            descent.move_to(state, found)
            if descent.outcome() or descent.residual <= 0:
                raise _LeaveError
        elif descent.evaluations >= descent.stop.evaluations:
            raise _LeaveError
        return found.energy / self.scale, self.unit / self.scale * found.gradient
