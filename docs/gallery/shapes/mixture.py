"""
A mixture of discs and rods
===========================

Parameters of a shape may be arrays with one entry for each kind of particle: a quarter of these particles are rods, of
a size between 0.8 and 1.2 of the mean.
"""

import jamshape as js

mixture = js.Spherocylinders(alpha=[0, 4], size=[1, 1], share=[0.75, 0.25], spread=[0, 0.1])
packing = js.make_packing(mixture, n=128, u0=1e-10, progress=False)
print(f"phi = {packing.phi:.4f}, rattlers: {packing.n_rattlers}")
js.plot(packing)
