"""L-BFGS and Newton's method, compiled beside the landscape."""

from __future__ import annotations

import math

from jamshape.landscape.newton import LONGEST_STEP, WIDEST_TURN, least_shift
from jamshape.landscape.vicinity import DescentStop, Vicinity
from jamshape.minima.corners import at_rest
from jamshape.minima.descent import Descent, Outcome, rounding_of_a_bond

# L-BFGS, cheap while contacts open and close, hands over to Newton's method below this residual.
_NEWTON_BELOW = 1e-2


def auto(descent: Descent) -> Outcome:
    """Use L-BFGS, then Newton's method near a minimum."""
    return _descend(descent, _NEWTON_BELOW)


def near(descent: Descent) -> Outcome:
    """Begin with Newton's method, then as `auto`: for a start close to a minimum."""
    return _descend(descent, _NEWTON_BELOW, is_near=True)


def newton(descent: Descent) -> Outcome:
    """Take Newton steps with the analytic Hessian, shifted where it is not positive definite."""
    return _descend(descent, math.inf)


def _descend(descent: Descent, newton_below: float, *, is_near: bool = False) -> Outcome:
    landscape, stop = descent.landscape, descent.stop
    if outcome := descent.outcome():
        return outcome
    about = DescentStop(
        tolerance=stop.tolerance,
        lowest=descent.lowest * descent.state.volume,
        evaluations=stop.evaluations - descent.evaluations,
        seconds=stop.seconds - descent.seconds,
        rounding=rounding_of_a_bond(landscape, extended=False),
        newton_below=newton_below,
        is_near=is_near,
        longest_step=LONGEST_STEP * 0.5 * landscape.length,
        widest_turn=WIDEST_TURN,
    )
    vicinity = Vicinity(landscape, descent.state)
    end = vicinity.descend(about, least_shift(landscape, descent.evaluation))
    descent.take(vicinity.base, end)
    return _on_a_corner(descent) or Outcome(end.outcome)


def _on_a_corner(descent: Descent) -> Outcome | None:
    """Relax a state that oscillates across a kink onto it; None without a kink."""
    if descent.outcome() is not None:
        return None
    found = at_rest(descent.landscape, descent.state, descent.stop.tolerance)
    if found is None:
        return None
    descent.move_to(found.state, found.evaluation)
    return Outcome.CORNER if found.n_sides > 1 else Outcome.CONVERGED
