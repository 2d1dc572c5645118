"""
A packing at a pressure, without shear stress
=============================================

In a box that is free to yield, all components of the pressure tensor reach their targets: the pressure on the diagonal, and no
shear stress. The box is no longer square.
"""

import jamshape as js

ellipses = js.Superellipsoids(p=1, w1=0.6)
packing = js.make_packing(ellipses, n=48, dimension=2, pressure=1e-3, box="free", progress=False)
print(js.energy(packing).pressure_tensor)
js.plot(packing)
