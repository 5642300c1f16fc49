"""Flat shapes: plane, disk, rectangle, polygon.

A flat shape has a plane with coordinates x, y of its own.  `base.py` has the columns of its table
and the kernels that all share: `meet` returns where a ray meets the plane, with x and y as u and v,
and t = inf for a parallel ray; a shape's `intersect` only decides whether x, y are inside of it.
`surface_at` returns the point at x, y.  The contract is that of `shapes`.  A map that flips
orientation leaves the front in front.

To add one: a file whose table begins with the columns of `base.columns`, and what `shapes` says.
"""
