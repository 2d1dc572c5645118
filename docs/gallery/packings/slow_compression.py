"""
A slow compression
==================

At slow rates implicit time steps are as long as the motion allows. Two rates, a factor of 100 apart: at the slower one p(phi) hardly depends on
the rate any more.
"""

import matplotlib.pyplot as plt

import jamshape as js

rods = js.Spherocylinders(alpha=1)
start = js.compress(rods, n=32, phi=(0.5, 0.8), kappa=1e-4, progress=False).packing()
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for kappa in (1e-6, 1e-8):
    run = js.slow_compress(start=start, phi=(0.8, 0.9), kappa=kappa, progress=False)
    axes.plot(run.phi, run.pressure, label=rf"$\kappa = {kappa:g}$")
axes.set(xlabel=r"packing fraction $\phi$", ylabel="pressure $p$", yscale="log", ylim=(1e-7, None))
axes.legend()
