"""Energy minimisation, and packings at a target energy."""

from jamshape.minima.descent import (
    Descent,
    History,
    Minimum,
    Outcome,
    Residual,
    Stop,
    residual_of,
    rounding_floor,
)
from jamshape.minima.minimise import METHODS, minimise

__all__ = [
    "METHODS",
    "Descent",
    "History",
    "Minimum",
    "Outcome",
    "Residual",
    "Stop",
    "minimise",
    "residual_of",
    "rounding_floor",
]
