"""
Superellipsoids with two exponents
==================================

With an exponent along the axis z and another one across it, superellipsoids include cylinders with rounded edges:
:math:`(|x/a|^{n_2} + |y/b|^{n_2})^{n_1/n_2} + |z/c|^{n_1} = 1` with :math:`n_1 = 8` and :math:`n_2 = 2`.
"""

import jamshape as js

cylinders = js.Superellipsoids(n1=8, n2=2, w2=1.4)
packing = js.make_packing(cylinders, n=32, u0=1e-6, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}")
js.plot(packing, color="orientation")
