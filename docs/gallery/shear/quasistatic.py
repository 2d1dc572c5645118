"""
Quasistatic shear
=================

Small strain steps, each followed by a minimisation. Stress rises while the packing stays in one minimum, and drops where that
minimum disappears.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=1)
packing = js.make_packing(rods, n=48, u0=1e-4, progress=False)
run = js.quasistatic_shear(start=packing, step=2e-3, strain=0.3, progress=False)
print(f"{len(run.events())} drops of the stress")
js.plot(run)
