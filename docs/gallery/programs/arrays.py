"""
Positions of an experiment as arrays
====================================

A packing can be made from plain arrays, such as those of an image analysis. This one fills a square with ellipses at random, and removes their overlaps.
"""

import matplotlib.pyplot as plt
import numpy as np

import jamshape as js

rng = np.random.default_rng(1)
xy, angle = rng.uniform(0, 10, (60, 2)), rng.uniform(0, np.pi, 60)
measured = js.Packing.of("superellipsoid", xy, angle, box=[10, 10], p=1, w1=0.5, w2=1, size=0.45)
settled = js.minimise(measured, progress=False)
print(f"phi = {measured.phi:.3f}, u = {measured.u:.3g} -> {settled.u:.3g}")
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 5), layout="constrained")
js.plot(measured, left, color="orientation")
js.plot(settled, right, color="orientation")
