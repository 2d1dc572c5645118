"""
Cyclic shear at a rate
======================

Discs sheared to and fro in LAMMPS. The mean squared displacement of the particles between the ends of a cycle falls as they find
positions to which they return.
"""

import matplotlib.pyplot as plt

import jamshape as js

discs = js.Spherocylinders(alpha=0)
run = js.cyclic_shear(
    discs, n=48, phi=0.8, amplitude=0.02, period=200, cycles=20, file="cycles.h5", progress=False
)
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
js.plot(run, left)
right.semilogy(range(1, 21), run.displacement, "o-")
right.set(xlabel="cycle", ylabel="mean squared displacement")
