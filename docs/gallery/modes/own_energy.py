"""
Compare energies with your own code
===================================

The energy of discs in five lines of NumPy, beside that of the library, for random displacements of growing magnitude.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

packing = js.make_packing(js.Spherocylinders(alpha=0), n=32, u0=1e-6, progress=False)
i, j = np.triu_indices(packing.n, 1)
noise = np.random.default_rng(1).normal(size=packing.position.shape)
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
for scale in np.logspace(-5, -1, 20):
    moved = packing.with_(position=packing.position + scale * noise)
    r = moved.position[i] - moved.position[j]
    r -= moved.box.edges * np.rint(r / moved.box.edges)
    overlap = 1 - np.linalg.norm(r, axis=1) / (moved.radius[i] + moved.radius[j])
    mine = 0.5 * (overlap[overlap > 0] ** 2).sum()
    axes.loglog(scale, mine, "k+", ms=10)
    axes.loglog(scale, js.energy(moved).U, "o", mfc="none", mec="C0")
axes.set(xlabel="displacement", ylabel="$U$: own (+) and jamshape (o)")
