"""
Translations, rotations and quartic modes of ellipses
=====================================================

Nearly round ellipses have fewer contacts than degrees of freedom. The modes without a restoring force at jamming are rotations; they
get one from the overlaps.
"""

import matplotlib.pyplot as plt

import jamshape as js

ellipses = js.Superellipsoids(p=1, w1=0.9)
packing = js.make_packing(ellipses, n=64, dimension=2, u0=1e-10, progress=False)
modes = js.modes(packing)
kept = modes.vibrational
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
axes.semilogx(modes.omega[kept], modes["rotation"][kept], ".")
axes.set(xlabel=r"frequency $\omega$", ylabel="fraction of the motion that is rotation")
