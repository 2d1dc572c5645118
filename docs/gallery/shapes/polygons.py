"""
Rounded polygons
================

A spheropolygon is a convex polygon with round corners: all points within a rounding radius of it. Triangles and pentagons
share the packing equally.
"""

import jamshape as js

corners = [js.regular_polygon(3), js.regular_polygon(5)]
polygons = js.Spheropolygons(corners=corners, size=[1.3, 0.8], rounding=0.15)
packing = js.make_packing(polygons, n=64, u0=1e-8, progress=False)
print(f"phi = {packing.phi:.4f}, z = {packing.z:.3f}, contacts {packing.z_single:.3f}")
js.plot(packing)
