"""Constructors of particles by shape: a function for each shape of the table, such as `Spherocylinders`.

>>> Spherocylinders(alpha=4)
Particles('spherocylinder', alpha=4, size_ratio=1.4)
>>> discs_among_rods = Spherocylinders(alpha=[0, 4], size=[1, 1.4], share=[3, 1])
>>> discs_among_rods.told["kinds"]
'alpha=0.0,size=1.0,share=3.0,spread=0.0; alpha=4.0,size=1.4,share=1.0,spread=0.0'
"""

from jamshape.shapes.constructors import constructor
from jamshape.shapes.table import SHAPES

__all__ = [shape.compiled_name for shape in SHAPES.values()]
globals().update({shape.compiled_name: constructor(shape) for shape in SHAPES.values()})
__test__ = {name: globals()[name].__doc__ for name in __all__}  # for doctest
