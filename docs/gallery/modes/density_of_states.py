"""
Density of states
=================

The frequencies of all modes of a packing of short rods just above jamming. They have fewer contacts than degrees of freedom, so that
rotations form a band far below all other modes.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=0.1)
packing = js.make_packing(rods, n=128, u0=1e-12, progress=False)
modes = js.modes(packing)
print(modes)
js.plot(modes)
