"""
Superballs
==========

The body :math:`|x|^{2p} + |y|^{2p} + |z|^{2p} = 1` goes from an octahedron (p near 1/2) through a ball (p = 1) to a cube.
Here it is nearly a cube with rounded edges.
"""

import jamshape as js

superballs = js.Superellipsoids(p=2.5)
packing = js.make_packing(superballs, n=48, u0=1e-7, progress=False)
print(f"phi = {packing.phi:.4f}, cubatic order C_4 = {packing.C_4:.3f}")
js.plot(packing)
