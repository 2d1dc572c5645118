r"""
Compression at a rate, and the onset of jamming
===============================================

Overdamped rods are compressed at the rate :math:`\kappa` in LAMMPS. A fit of :math:`p(\phi)` gives :math:`\phi_J(\kappa)`, which for
flowing rods lies below the packing fraction at which frames of the run stay jammed when they are minimised. The figure shows both.
"""

import jamshape as js

rods = js.Spherocylinders(alpha=2)
run = js.compress(rods, n=64, phi=(0.6, 0.9), kappa=3e-5, frames=60, file="run.h5", progress=False)
jamming = run.jamming(progress=False)
print(
    f"phi_J(kappa) = {run.onset().phi_J:.4f}; frames jam between {jamming.unjams:.4f} and {jamming.jams:.4f}"
)
js.plot(run)
