"""
A slow compression
==================

At slow rates implicit time steps are as long as the motion allows. Below jamming the pressure is that of the flow, and proportional to the rate;
above, the curves meet.
"""

import matplotlib.pyplot as plt

import jamshape as js

rods = js.Spherocylinders(alpha=1)
start = js.compress(rods, n=24, phi=(0.5, 0.82), kappa=1e-4, progress=False).packing()
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for kappa in (1e-6, 1e-8):
    run = js.slow_compress(start=start, phi=(0.82, 0.92), kappa=kappa, progress=False)
    axes.semilogy(run.phi, run.pressure, label=rf"$\kappa$ = {kappa:g}")
axes.set(xlabel=r"packing fraction $\phi$", ylabel="pressure $p$", ylim=(1e-8, None))
axes.legend()
