"""
Ellipses
========

Ellipses are superellipsoids with the exponent p = 1 in the plane, here with semi-axes of the ratio 0.5. Their contact
number is below 6, twice the number of degrees of freedom of each.
"""

import jamshape as js

ellipses = js.Superellipsoids(p=1, w1=0.5)
packing = js.make_packing(ellipses, n=96, dimension=2, u0=1e-9, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}, isostatic {packing.z_iso}")
js.plot(packing, color="orientation")
