"""
Rods in the plane
=================

Spherocylinders of aspect ratio 4, five times as long as wide, in two sizes, just above jamming. Colour shows their
direction, modulo a half turn, and red dots are points of contact: two for rods side by side.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=4)
packing = js.make_packing(rods, n=128, u0=1e-10, progress=False)
print(packing)
js.plot(packing, color="orientation")
