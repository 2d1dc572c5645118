"""
A movie of a mode
=================

Near jamming rods side by side slide past each other without a force, but for their overlap: the softest mode of a packing. Particles swing
along the eigenvector.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=6)
packing = js.make_packing(rods, n=32, u0=1e-12, seed=13, progress=False)
modes = js.modes(packing)
sliding = int(modes["parallel"].argmax())
print(f"omega = {modes.omega[sliding]:.1g}, motion along rods {modes['parallel'][sliding]:.3f}")
js.animate(modes, sliding, "mode.gif", dpi=70)
