"""
Steady shear at a rate
======================

Rods sheared at a constant rate and packing fraction, in LAMMPS. Averages over the steady state come with errors, from blocks longer
than the strain over which samples are correlated.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=2)
run = js.shear(rods, n=48, phi=0.85, gdot=1e-3, strain=5, file="steady.h5", progress=False)
steady = run.steady()
print(
    f"from a strain of {steady.startup:.2f}: mu = {steady['mu'].value:.3f} +- {steady['mu'].error:.3f}"
)
print(
    f"rotation over strain {steady['rotation'].value:.3f}, nematic order {steady['S_2'].value:.3f}"
)
js.plot(run)
