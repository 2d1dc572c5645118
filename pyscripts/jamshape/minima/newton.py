"""L-BFGS and Newton's method, compiled beside the landscape."""

from __future__ import annotations

import math

from jamshape.landscape.local_energy_model import DescentStop, LocalEnergyModel
from jamshape.landscape.newton import LONGEST_STEP, WIDEST_TURN, least_shift
from jamshape.minima.descent import Descent, Outcome, rounding_of_a_bond
from jamshape.minima.nonsmooth import relax

# L-BFGS, cheap while contacts open and close, hands over to Newton's method below this residual; later where its equations are
# solved by iterations (landscape/descent.hpp).
_NEWTON_BELOW = 1e-2

# Evaluations without a gain after which a minimisation has stalled, usually on a kink; and, for a tolerance this fine, after
# which it has stalled without a kink, where flat sides slide. On the way to an energy a stalled state suffices.
_PATIENCE, _LONG_PATIENCE, _FINE = 500, 5000, 1e-6


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
    """Minimise; after a stall without a kink, follow sliding particles with more patience.

    In 2D by Newton's method alone, which takes in contacts one by one; in 3D one of its steps takes as long as tens of steps of
    L-BFGS, which lower the energy further.
    """
    outcome = descent.outcome()
    if outcome is None:
        outcome = _run(descent, newton_below, _PATIENCE, is_near=is_near)
    if outcome is Outcome.STALLED and descent.stop.tolerance <= _FINE:
        is_plane = descent.landscape.particles.dimension == 2
        outcome = _run(descent, math.inf if is_plane else newton_below, _LONG_PATIENCE)
    return outcome


def _run(descent: Descent, newton_below: float, patience: int, *, is_near: bool = False) -> Outcome:
    landscape, stop = descent.landscape, descent.stop
    about = DescentStop(
        tolerance=stop.tolerance,
        lowest=descent.lowest * descent.state.volume,
        evaluations=stop.evaluations - descent.evaluations,
        seconds=stop.seconds - descent.seconds,
        rounding=rounding_of_a_bond(landscape, extended=False),
        patience=patience,
        newton_below=newton_below,
        is_near=is_near,
        longest_step=LONGEST_STEP * 0.5 * landscape.length,
        widest_turn=WIDEST_TURN,
    )
    local_model = LocalEnergyModel(landscape, descent.state)
    end = local_model.descend(about, least_shift(landscape, descent.evaluation))
    descent.take(local_model.base, end)
    return _relaxed(descent) or Outcome(end.outcome)


def _relaxed(descent: Descent) -> Outcome | None:
    """Relax a state that oscillates across a kink onto it; None if it does not come to rest.

    Forces between round particles are continuous.
    """
    is_wanted = descent.stop.kinks and descent.outcome() is None
    if not is_wanted or descent.landscape.particles.is_round.all():
        return None
    return relax(descent)
