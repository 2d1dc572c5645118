"""
Quasistatic shear to and fro
============================

The strain is a triangle wave. The area of a loop is the energy that rearrangements dissipate; after two cycles this packing
returns to the same states, and the loop closes although it loses energy.
"""

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=48, u0=1e-4, seed=2, progress=False)
run = js.quasistatic_shear(start=packing, step=2e-3, amplitude=0.03, cycles=5, progress=False)
for cycle in run.cycles():
    print(f"cycle {cycle.number}: lost {cycle.lost:.2e}, reversible: {cycle.is_reversible}")
js.plot(run)
