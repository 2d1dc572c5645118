"""
Contact number against pressure
===============================

A ladder takes one packing through pressures. The contact number above that of an isostatic packing, :math:`4 - 2/N` without
rattlers, grows as the square root of the pressure. Below a pressure of 1e-5 this packing is isostatic.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=200, pressure=3e-2, progress=False)
run = js.ladder(packing, pressure=np.logspace(-1.75, -6, 18).tolist(), progress=False)
excess = run["z"] - 4 + 2 / (packing.n - run["rattlers"])
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
axes.loglog(run.pressure, excess, "o")
axes.loglog(run.pressure, 6 * np.sqrt(run.pressure), "k--", label=r"$6\,p^{1/2}$")
axes.set(xlabel=r"pressure $p$", ylabel=r"$z - z_{\mathrm{iso}}$", ylim=(3e-3, None))
axes.legend()
