"""
Ellipsoids
==========

Ellipsoids with three different semi-axes, a : b : c = 0.7 : 1 : 1.3. They pack more densely than spheres.
"""

import jamshape as js

ellipsoids = js.Superellipsoids(p=1, w1=0.7, w2=1.3)
packing = js.make_packing(ellipsoids, n=48, u0=1e-7, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}")
js.plot(packing, color="orientation")
