"""
Pair correlations and bond order by freud
=========================================

freud takes the frames of a run. Here it averages the pair correlation function g(r) over packings of discs.
"""

import freud
import matplotlib.pyplot as plt

import jamshape as js

discs = js.Spherocylinders(alpha=0)
rdf = freud.density.RDF(bins=80, r_max=4)
for seed in range(1, 9):
    packing = js.make_packing(discs, n=100, u0=1e-8, seed=seed, progress=False)
    rdf.compute(system=packing.to_freud().system, reset=False)
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
axes.plot(rdf.bin_centers, rdf.rdf)
axes.set(xlabel="distance $r$", ylabel="$g(r)$")
