"""
A movie of a mode
=================

The softest vibration of a packing of long rods: two of them slide past each other. Particles swing along the eigenvector.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=4)
packing = js.make_packing(rods, n=32, u0=1e-8, progress=False)
modes = js.modes(packing)
softest = int(modes.vibrational[0])
print(f"omega = {modes.omega[softest]:.3g}, participation {modes.participation[softest]:.3f}")
js.animate(modes, softest, "mode.gif", dpi=70)
