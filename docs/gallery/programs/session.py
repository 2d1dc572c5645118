"""
LAMMPS in the same process
==========================

A ``Session`` is LAMMPS with the plugin, in Python. States go there and back: here discs are sheared by the fix of the plugin, to a
strain of 0.2.
"""

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=64, u0=1e-4, progress=False)
with js.Session() as session:
    session.load(packing)
    session.interact(packing.law)
    session.commands("change_box all triclinic\ntimestep 0.1")
    session.commands("fix flow all overdamped/affine drag 1.0 shear 1e-3\nrun 2000")
    sheared = js.load(session)
print(f"u = {packing.u:.3g} -> {sheared.u:.3g}")
js.plot(sheared)
