"""
Where rods jam
==============

Packing fraction at jamming against aspect ratio: it rises at first, as rods fill gaps that discs leave, and falls where long
rods hinder each other.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

alphas = [0, 0.1, 0.2, 0.5, 1, 2, 4, 6]
phi_J = []
for alpha in alphas:
    rods = js.Spherocylinders(alpha=alpha)
    table = js.ensemble(rods, n=32, u0=1e-12, seeds=range(1, 7), progress=False)
    phi_J.append(table["phi_J"])
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
axes.errorbar(alphas, np.mean(phi_J, axis=1), np.std(phi_J, axis=1) / np.sqrt(5), fmt="o-")
axes.set(xlabel=r"aspect ratio $\alpha$", ylabel=r"$\phi_J$")
