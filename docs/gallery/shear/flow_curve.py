"""
A flow curve
============

Stress against rate, below and above jamming of discs: it vanishes with the rate below, and tends to a yield stress above.
"""

import matplotlib.pyplot as plt

import jamshape as js

discs = js.Spherocylinders(alpha=0)
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for phi in (0.78, 0.95):
    sigma = []
    for gdot in (1e-4, 1e-3, 1e-2):
        run = js.shear(discs, n=32, phi=phi, gdot=gdot, strain=2, progress=False)
        sigma.append(run.steady()["sigma"])
    axes.errorbar(
        [1e-4, 1e-3, 1e-2],
        [s.value for s in sigma],
        [s.error for s in sigma],
        fmt="o-",
        label=rf"$\phi = {phi}$",
    )
axes.set(xscale="log", yscale="log", xlabel=r"rate $\dot\gamma$", ylabel=r"stress $\sigma$")
axes.legend()
