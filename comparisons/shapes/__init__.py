"""Shapes -> Mitsuba: `translate_shape`, with a function for each type in the file of its kind.

Contract: (description, `Site`) -> a list of `Plugin`, each a Mitsuba shape and how to convert its
hits; lengths in scene coordinates.  A part of `primitives` uses Mitsuba's own shapes, `meshes`
exact triangles.  Elsewhere a fine mesh stands in (`stand_ins`; `canonical` and `surfaces` make it),
whose distance from the surface is measured.  To add a shape: such a function in a module that is
imported here.
"""

from comparisons.shapes import meshes, primitives
from comparisons.shapes.meshes import Site, translate_shape

__all__ = ["Site", "meshes", "primitives", "translate_shape"]
