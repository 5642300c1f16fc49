"""Curved shapes: sphere, torus, and quadrics, whose table cylinders, cones and ellipsoids share.

The contract is that of `shapes`.  All are solids, so that they have `spans`, except a quadric whose
table says that it is not capped: that is a surface alone, seen from both sides.  Quadrics and tori
are intersected in their own coordinates (`placement.py`); `quadric.py` puts a quadric into
coordinates where floats serve it best, exactly, when the scene is built.

To add a quadric: a description whose `tabulate` calls `quadric.tabulate` with its ten coefficients
and its clip box, as `Cone` does; no kernels are needed.  To add another surface: a file as
`torus.py`, and what `shapes` says.
"""
