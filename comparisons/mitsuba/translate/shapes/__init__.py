"""Shapes -> Mitsuba: `translate_shape`, with a function for each type in the file of its kind.

Contract: (description, `Site`) -> a list of `Plugin`, each a Mitsuba shape and how to convert its
hits; lengths in scene coordinates.  `native` and part of `quadrics` use Mitsuba's own shapes,
`flat` and `meshes` exact triangles.  Elsewhere a fine mesh stands in (`stand_ins`, `canonical`,
`caps`), whose distance from the surface is measured.  To add a shape: such a function in a module
that is imported here.
"""

from comparisons.mitsuba.translate.shapes import flat, meshes, native, quadrics, tori
from comparisons.mitsuba.translate.shapes.choice import translate_shape
from comparisons.mitsuba.translate.shapes.plugins import Site

__all__ = ["Site", "flat", "meshes", "native", "quadrics", "tori", "translate_shape"]
