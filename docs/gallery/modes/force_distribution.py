"""
Force network and distribution of forces
========================================

Contacts of discs carry forces of very different magnitudes: lines are as thick as the force.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=200, u0=1e-6, progress=False)
bonds = packing.contacts().network.bonds
force = np.linalg.norm(bonds.force, axis=1) / np.linalg.norm(bonds.force, axis=1).mean()
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.8), layout="constrained")
js.plot(packing, left, color="one")
points = packing.box.wrapped(bonds.point)[0] + packing.box.lo
for point, normal, f in zip(points, bonds.normal, force, strict=True):
    left.plot(*(point + np.outer([-0.5, 0.5], normal)).T, "k-", lw=2 * f, solid_capstyle="round")
right.hist(force, bins=30, density=True)
right.set(xlabel="force over its mean", ylabel="probability density")
