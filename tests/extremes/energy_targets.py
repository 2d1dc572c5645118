"""Small packings at an energy."""

from functools import cache

from extreme_shapes import SHAPES
from packings_in_a_box import scaled

from jamshape.landscape import Landscape, State
from jamshape.minima import Outcome
from jamshape.minima.target import Target, find

ENDED = (Outcome.CONVERGED, Outcome.SLIDING, Outcome.CORNER, Outcome.UNJAMMED)
STARTS = {name: scene for shape in SHAPES for name, scene in shape.jammed.items()}


@cache
def led(name, u0, length=1.0, k_e=1.0):
    """Landscape and minimum at an energy density of u0, in units of the length 1 and k_e 1."""
    packing = scaled(STARTS[name](), length)
    landscape = Landscape(packing, k_e)
    target = Target(u0 * k_e / length**packing.dimension, tolerance=1e-8)
    return landscape, find(landscape, State.of(packing), target)
