"""
The last frame of a dump of your own
====================================

A dump of another simulation states positions, orientations and diameters, but not the shape. Minimised, its last frame is a packing
with contacts, pressure and modes. The dump is made here first.
"""

import jamshape as js

run = js.compress(js.Spherocylinders(alpha=2), n=64, phi=(0.6, 0.95), kappa=1e-3, progress=False)
js.save("theirs.dump", run)

last = js.load("theirs.dump", shape="spherocylinder")
packing = js.minimise(last, progress=False)
print(f"u = {last.u:.3g} -> {packing.u:.3g}, z = {packing.z:.3f}")
js.plot(packing, color="nematic")
