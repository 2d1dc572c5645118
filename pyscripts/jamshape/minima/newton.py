"""Newton's method."""

from __future__ import annotations

from jamshape.landscape.newton import Regularised
from jamshape.minima.descent import Descent, Outcome
from jamshape.minima.line_search import limited, search_along

# A stall after so many evaluations without a gain.
_PATIENCE = 2000


def newton(descent: Descent) -> Outcome:
    """Sparse Newton steps with the analytic Hessian, shifted where it is not positive definite."""
    descent.be_patient(_PATIENCE)
    regularised = Regularised.of(descent.landscape)
    while not (outcome := descent.outcome()):
        curvature = descent.landscape.curvature(descent.state)
        step = -regularised.factorise(curvature.hessian).solve(descent.evaluation.gradient)
        found = search_along(descent, limited(descent.landscape, step))
        regularised.learn(found.tries)
        descent.move_to(found.state, found.evaluation)
    return outcome
