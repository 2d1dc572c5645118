"""
Hertz's law of contacts
=======================

The energy of a contact is its overlap to the power 2 (harmonic) or 5/2 (Hertz). The pressure above jamming rises with the
distance from it to the power 1 or 3/2 (dashed).
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for law, power in (("harmonic", 1.0), ("hertz", 1.5)):
    discs = js.Spherocylinders(alpha=0, law=law)
    packing = js.make_packing(discs, n=64, pressure=1e-3, progress=False)
    run = js.ladder(packing, pressure=np.logspace(-3.5, -10, 14).tolist(), progress=False)
    excess = (run.phi - run.phi[-1])[:-5]  # the last state is at jamming, nearly
    axes.loglog(excess, run.pressure[:-5], "o", label=law)
    axes.loglog(excess, run.pressure[0] * (excess / excess[0]) ** power, "k--", lw=1)
axes.set(xlabel=r"$\phi - \phi_J$", ylabel="pressure $p$")
axes.legend()
