"""
Clumps of balls in space
========================

In three dimensions the rows are x, y, z and the radius of each ball. These tetrapods interlock, so that they jam at a small
packing fraction.
"""

import jamshape as js

arms = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
balls = [[0, 0, 0, 0.3]] + [[x / 4, y / 4, z / 4, 0.22] for x, y, z in arms]
packing = js.make_packing(js.Clumps(discs=balls), n=16, dimension=3, u0=1e-6, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}")
js.plot(packing)
