"""
Clumps of your own
==================

Any rigid union of discs: rows are x, y and the radius of each. The body is moved to its centre of area, and rotated to its
principal axes. A list of lists is a mixture.
"""

import jamshape as js

star = [[0, 0, 0.4], [0.6, 0, 0.3], [-0.3, 0.5, 0.3], [-0.3, -0.5, 0.3]]
hook = [[0, 0, 0.3], [0.5, 0, 0.3], [1, 0, 0.3], [1, 0.5, 0.3]]
packing = js.make_packing(js.Clumps(discs=[star, hook]), n=32, u0=1e-8, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}")
js.plot(packing)
