"""
Where rods jam
==============

Packing fraction at jamming against aspect ratio, a mean over eight packings each: it rises at first, as rods turn into gaps that discs
leave, and falls where long rods hinder each other.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for alpha in (0, 0.1, 0.2, 0.5, 1, 2, 4, 6):
    rods = js.Spherocylinders(alpha=alpha)
    made = [js.make_packing(rods, n=32, u0=1e-12, seed=k, progress=False) for k in range(8)]
    phi_J = np.array([packing.results["phi_J"] for packing in made if packing.reached])
    axes.errorbar(alpha, phi_J.mean(), phi_J.std() / len(phi_J) ** 0.5, fmt="C0o", capsize=3)
axes.set(xlabel=r"aspect ratio $\alpha$", ylabel=r"$\phi_J$")
