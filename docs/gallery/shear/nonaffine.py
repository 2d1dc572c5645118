"""
Nonaffine displacements
=======================

Where particles go beside the affine motion of the box, between two states of a quasistatic shear: arrows are 20 times
the displacements. Circles mark the five particles with the largest D2_min, whose neighbours deform least affinely.
"""

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=128, u0=1e-4, progress=False)
run = js.quasistatic_shear(start=packing, step=1e-3, strain=5e-3, progress=False)
moves = js.nonaffine(packing, run.packing())
print(moves)
axes = js.plot(packing, color="one")
x, y = (packing.box.wrapped(packing.position)[0] + packing.box.lo).T
axes.quiver(x, y, *(20 * moves.displacement.T), angles="xy", scale_units="xy", scale=1, zorder=10)
most = moves.D2_min.argsort()[-5:]
axes.plot(x[most], y[most], "o", ms=26, mfc="none", mec="k", mew=2)
