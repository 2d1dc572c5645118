"""
Files for OVITO and HOOMD-blue
==============================

GSD files keep each type's shape, so that OVITO draws the particles as they are: open ``rods.gsd`` there. They also
keep all digits: the packing read back is the same.
"""

import gsd.hoomd

import jamshape as js

polygons = js.Clumps(discs=js.trimer_discs(90))
packing = js.make_packing(polygons, n=48, u0=1e-8, progress=False)
packing.to_gsd("trimers.gsd")
with gsd.hoomd.open("trimers.gsd") as file:
    print("shape of a type:", file[0].particles.type_shapes[0]["type"])
again = js.load("trimers.gsd")
print("same positions:", (again.position == packing.position).all())
js.plot(again)
