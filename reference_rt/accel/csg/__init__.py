"""Rays against CSG solids: evaluated along the ray, in a leaf of the scene's BVH.

`evaluate.py` finds where a ray crosses the surface of a solid, from the crossings of its operands
and a postfix program; `mesh_walk.py` gives the crossings of an operand that is a closed mesh, which
has a BVH of its own.  Other operands give theirs as `Spans`, see `shapes.dispatch.spans`.

t is that of the ray as given.  Inside, rays start near the solid's anchor (`ray_near`), so that
rounding is relative to the solid's size rather than to its distance from the origin.
"""
