"""
Density of states
=================

The frequencies of all modes of a packing of rods just above jamming. Rods side by side slide almost without a force, in a band far
below all other modes.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=4)
packing = js.make_packing(rods, n=128, u0=1e-12, progress=False)
modes = js.modes(packing)
print(modes)
js.plot(modes)
