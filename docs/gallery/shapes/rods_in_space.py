"""
Rods in space
=============

The same particles in three dimensions, with a cylinder as long as it is wide between their round ends, and the contact
number beside the isostatic one. A rod that spins about its axis feels no torque, which leaves five degrees of freedom.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=1)
packing = js.make_packing(rods, n=64, dimension=3, u0=1e-8, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}, isostatic {packing.z_iso}")
js.plot(packing)
