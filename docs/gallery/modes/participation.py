"""
Participation ratios of many packings
=====================================

Modes of ten packings, each a point. Modes at low frequencies are spread over a packing or localised; those at the highest
frequencies involve few particles.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import jamshape as js

rods = js.Spherocylinders(alpha=1)
js.ensemble(rods, n=32, u0=1e-8, seeds=range(1, 11), folder="ten", progress=False)
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for path in sorted(Path("ten").glob("*_seed*.h5")):
    modes = js.modes(path)
    kept = modes.vibrational
    axes.loglog(modes.omega[kept], modes.participation[kept], "k.", ms=3)
axes.set(xlabel=r"frequency $\omega$", ylabel="participation ratio")
