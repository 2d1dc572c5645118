"""
Packing fraction and contact number against pressure
====================================================

A ladder takes one packing through pressures. The excess contact number grows as the square root of the pressure.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=128, pressure=1e-2, progress=False)
run = js.ladder(packing, pressure=np.logspace(-2.25, -6, 16).tolist(), progress=False)
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
axes.loglog(run.pressure, run["z"] - packing.z_iso, "o")
axes.loglog(run.pressure, 6 * np.sqrt(run.pressure), "k--", label=r"$\propto p^{1/2}$")
axes.set(xlabel=r"pressure $p$", ylabel=r"$z - z_{\mathrm{iso}}$")
axes.legend()
