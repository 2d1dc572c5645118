"""
All elastic constants
=====================

The tensor :math:`C_{ijkl}` of a packing as a matrix over xx, yy and xy, each entry with a bound of its error. Small packings are
anisotropic: entries that couple shear to compression do not vanish.
"""

import matplotlib.pyplot as plt

import jamshape as js

rods = js.Spherocylinders(alpha=1)
packing = js.make_packing(rods, n=64, u0=1e-5, progress=False)
C = js.modes(packing).moduli.C
print(f"largest bound of an error {C.bound.max():.1e}")
figure, axes = plt.subplots(figsize=(4.5, 3.8), layout="constrained")
shown = axes.imshow(C.relaxed, cmap="PuOr", vmin=-0.8, vmax=0.8)
axes.set(xticks=range(3), yticks=range(3), xticklabels=C.components, yticklabels=C.components)
for k in range(9):
    axes.text(k % 3, k // 3, f"{C.relaxed.flat[k]:.4f}", ha="center", va="center")
figure.colorbar(shown, label=r"$C_{ijkl}$")
