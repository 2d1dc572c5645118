"""
An ensemble of packings
=======================

One packing for each seed, on all cores, as a table. A histogram of their packing fractions at jamming is drawn by one call.
"""

import jamshape as js

discs = js.Spherocylinders(alpha=0)
table = js.ensemble(discs, n=24, u0=1e-12, seeds=range(64), file="discs.h5", progress=False)
print(table)
print(f"z = {table['z'].mean():.3f}, {table['n_rattlers'].mean():.2f} rattlers in a packing")
js.plot(table)
