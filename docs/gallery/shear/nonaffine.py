"""
Nonaffine displacements
=======================

Where particles go beside the affine motion of the box, between two states of a quasistatic shear: arrows are 20 times
the displacements, and dark where the surroundings of a particle deform least affinely (large D2_min).
"""

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=128, u0=1e-4, progress=False)
run = js.quasistatic_shear(start=packing, step=1e-3, strain=5e-3, progress=False)
moves = js.nonaffine(packing, run.packing())
print(moves)
axes = js.plot(packing, color="one")
x, y = (packing.box.wrapped(packing.position)[0] + packing.box.lo).T
arrows = {"angles": "xy", "scale_units": "xy", "scale": 1, "cmap": "inferno_r", "zorder": 10}
axes.quiver(x, y, *(20 * moves.displacement.T), moves.D2_min, **arrows)
