"""
The yield stress
================

Here the shear stress is raised in steps, at a constant pressure, until the packing flows.
"""

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=48, pressure=1e-2, box="free", progress=False)
run = js.quasistatic_shear(start=packing, pressure=1e-2, stress_step=1e-4, progress=False)
print(f"yield stress {run.yield_stress.value:.5f} +- {run.yield_stress.error:.5f}")
js.plot(run)
