"""Written by tests/house/stubs.py from the table of shapes."""

from numpy.typing import ArrayLike

from jamshape.shapes.particles import Particles

def Spherocylinders(
    alpha: ArrayLike = 4.0,
    size_ratio: float | None = None,
    law: str | float = ...,
    **kinds: ArrayLike,
) -> Particles: ...
def Superellipsoids(
    p: ArrayLike = 1.0,
    w1: ArrayLike = 1.0,
    w2: ArrayLike = 1.0,
    n1: ArrayLike | None = None,
    n2: ArrayLike | None = None,
    size_ratio: float | None = None,
    law: str | float = ...,
    **kinds: ArrayLike,
) -> Particles: ...
def Dimers(
    alpha: ArrayLike = 1.0,
    size_ratio: float | None = None,
    law: str | float = ...,
    **kinds: ArrayLike,
) -> Particles: ...
def Clumps(
    discs: ArrayLike = ...,
    size_ratio: float | None = None,
    law: str | float = ...,
    **kinds: ArrayLike,
) -> Particles: ...
def Spheropolygons(
    corners: ArrayLike = ...,
    rounding: ArrayLike = 0.1,
    size_ratio: float | None = None,
    law: str | float = ...,
    **kinds: ArrayLike,
) -> Particles: ...
