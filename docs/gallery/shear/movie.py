"""
A movie of a shear
==================

The frames of a run make a movie. The dashed box deforms; when its tilt reaches half an edge, it is described by other edge vectors of the
same lattice.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=4)
packing = js.make_packing(rods, n=32, u0=1e-5, progress=False)
run = js.quasistatic_shear(start=packing, step=1e-2, strain=0.4, frames=40, progress=False)
js.animate(run, "shear.gif", color="orientation", dpi=70)
