"""
Hertz's law of contacts
=======================

The energy of a contact is its overlap to the power 2 (harmonic) or 5/2 (Hertz). The pressure above jamming rises with the
overlap to the power 1 or 3/2.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for law, exponent in (("harmonic", 1.0), ("hertz", 1.5)):
    discs = js.Spherocylinders(alpha=0, law=law)
    packing = js.make_packing(discs, n=64, pressure=1e-3, progress=False)
    run = js.ladder(packing, pressure=np.logspace(-3.5, -8, 10).tolist(), progress=False)
    deepest = js.make_packing(discs, n=64, start=None, pressure=1e-10, progress=False)
    excess = run.phi - run.phi[-1]
    axes.loglog(excess[:-2], run.pressure[:-2], "o", label=law)
    axes.loglog(excess[:-2], run.pressure[0] * (excess[:-2] / excess[0]) ** exponent, "k--")
axes.set(xlabel=r"$\phi - \phi_J$", ylabel="pressure $p$")
axes.legend()
