"""
Bumpy discs
===========

Discs with bumps on their rims mimic friction by geometry alone: twelve discs around a large one are one rigid particle.
"""

import jamshape as js

bumpy = js.Clumps(discs=js.bumpy_discs(12, depth=0.3))
packing = js.make_packing(bumpy, n=32, u0=1e-8, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}, contacts {packing.z_single:.3f}")
js.plot(packing)
