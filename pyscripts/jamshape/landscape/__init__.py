"""Energy, gradient and Hessian of packings of any shape, and Newton steps on them."""

from jamshape.contacts import CrossingError
from jamshape.landscape.landscape import Curvature, Evaluation, Landscape, contracted
from jamshape.packing import State

__all__ = ["CrossingError", "Curvature", "Evaluation", "Landscape", "State", "contracted"]
