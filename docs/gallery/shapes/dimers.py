"""
Dimers
======

A dimer is two equal discs (balls in space), rigidly joined; ``alpha`` is half the distance of their centres over their radius.
Two dimers may touch at up to four points.
"""

import jamshape as js

dimers = js.Dimers(alpha=0.7)
packing = js.make_packing(dimers, n=96, u0=1e-10, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}, contacts {packing.z_single:.3f}")
js.plot(packing)
