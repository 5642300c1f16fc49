"""Shapes: a function for each type, in the file of its kind."""

from comparisons.mitsuba.translate.shapes import flat, meshes, native, quadrics, tori
from comparisons.mitsuba.translate.shapes.choice import translate_shape
from comparisons.mitsuba.translate.shapes.plugins import Site

__all__ = ["Site", "flat", "meshes", "native", "quadrics", "tori", "translate_shape"]
