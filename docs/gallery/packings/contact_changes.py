"""
Contacts that open, each located
================================

Between two states of a ladder each change of contacts is located by bisection, here to 1e-4 of the energy. Circles mark
the contacts of the dense packing that open on the way down.
"""

import numpy as np

import jamshape as js

discs = js.Spherocylinders(alpha=0)
packing = js.make_packing(discs, n=32, u0=1e-4, progress=False)
changes = js.ladder(packing, u0=[3e-5, 1e-5], progress=False).contact_changes(within=1e-4)
for change in changes:
    print(f"{change.change} at u = {change.after:.5g}: particles {change.ids}")
contacts = packing.contacts()
opened = {tuple(sorted(change.ids)) for change in changes}
lost = [tuple(sorted(packing.id[pair])) in opened for pair in contacts.pairs]
points = contacts.network.bonds.point[np.array(lost)[contacts.network.bonds.contact]]
axes = js.plot(packing)
inside = packing.box.wrapped(points)[0] + packing.box.lo
axes.plot(*inside.T, "o", ms=14, mfc="none", mec="k", mew=2)
