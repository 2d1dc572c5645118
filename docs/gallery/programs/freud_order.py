"""
Pair correlations by freud
==========================

freud takes packings, one by one or the frames of a run. Here it averages the pair correlation function g(r) over the jammed frames
of a compression of discs of two sizes: three peaks are the three contact distances.
"""

import freud
import matplotlib.pyplot as plt

import jamshape as js

discs = js.Spherocylinders(alpha=0)
js.compress(discs, n=100, phi=(0.5, 0.9), kappa=1e-4, file="discs.h5", progress=False)
rdf = freud.density.RDF(bins=100, r_max=4)
for packing in js.frames("discs.h5")[-8:]:
    rdf.compute(system=packing.to_freud().system, reset=False)
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
axes.plot(rdf.bin_centers, rdf.rdf)
axes.set(xlabel="distance $r$", ylabel="$g(r)$")
