"""Energy, gradient and Hessian of packings of any shape, and Newton steps on them."""

from jamshape.landscape.landscape import (
    CrossingError,
    Curvature,
    Evaluation,
    Landscape,
    Pairs,
    State,
)

__all__ = [
    "CrossingError",
    "Curvature",
    "Evaluation",
    "Landscape",
    "Pairs",
    "State",
]


__all__ = [
    "CrossingError",
    "Curvature",
    "Evaluation",
    "Landscape",
    "Pairs",
    "State",
]
