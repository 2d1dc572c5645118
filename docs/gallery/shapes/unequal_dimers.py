"""
Dimers of unequal discs
=======================

Two overlapping discs of different radii, as a clump: the small one has 0.6 times the diameter of the large one. Such particles have a
head and a tail.
"""

import jamshape as js

snowmen = js.Clumps(discs=js.dimer_discs(0.6))
packing = js.make_packing(snowmen, n=64, u0=1e-9, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}, contacts {packing.z_single:.3f}")
js.plot(packing)
