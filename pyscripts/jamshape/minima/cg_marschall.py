"""The conjugate gradients of Marschall & Teitel 2018, as printed."""

from __future__ import annotations

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.landscape import Evaluation
from jamshape.minima.descent import Descent, Outcome
from jamshape.packing import State


def cg_marschall(descent: Descent) -> Outcome:
    """Polak-Ribiere with the line search of Marschall & Teitel 2018, Appendix A, as printed."""
    restarted, epsilon = False, 1e-4
    direction = -descent.evaluation.gradient
    while not (outcome := descent.outcome()):
        gradient = descent.evaluation.gradient
        if restarted:
            direction = -gradient
        moved = _line_search(descent, direction / np.linalg.norm(direction), epsilon)
        if moved < 1e-16:
            if restarted:
                return Outcome.STALLED
            restarted, epsilon = True, 1e-4
            continue
        epsilon, restarted = moved, False
        new = descent.evaluation.gradient
        beta = float(new @ (new - gradient) / (gradient @ gradient))
        direction = -new + beta * direction
    return outcome


def _line_search(descent: Descent, direction: FloatArray, epsilon: float) -> float:
    """Bracket a minimum by three energies, fit a parabola, go there; return the last epsilon."""
    landscape, start = descent.landscape, descent.state

    def at(distance: float) -> tuple[State, Evaluation]:
        state = landscape.displaced(start, distance * direction)
        return state, landscape.evaluate(state, extended=False)

    here = landscape.evaluate(start, extended=False).energy
    while epsilon >= 1e-16:
        near, far = at(epsilon), at(2 * epsilon)
        once, twice = near[1].energy, far[1].energy
        if here <= once:
            epsilon /= 2
        elif once > twice:
            epsilon *= 2
        else:
            bend = here - 2 * once + twice
            vertex = at(epsilon * (1 + 0.5 * (here - twice) / bend)) if bend > 0 else near
            descent.move_to(*(vertex if vertex[1].energy < once else near))
            return epsilon
        if descent.evaluations >= descent.stop.evaluations:
            break
    return min(epsilon, 1e-17)
