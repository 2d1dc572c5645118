"""
One packing at many energies
============================

A packing is decompressed towards jamming through a ladder of energy densities. Contacts open on the way, until the number of
bonds is isostatic.
"""

import numpy as np

import jamshape as js

rods = js.Spherocylinders(alpha=1)
packing = js.make_packing(rods, n=64, u0=1e-3, progress=False)
run = js.ladder(packing, u0=np.logspace(-3.25, -10, 20).tolist(), progress=False)
print(f"z = {run['z'][-1]:.3f}, isostatic {packing.z_iso}")
js.plot(run)
