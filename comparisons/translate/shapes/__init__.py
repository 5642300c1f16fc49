"""Shapes: a function for each type, in the file of its kind."""

from comparisons.translate.shapes import flat, meshes, native, quadrics, tori
from comparisons.translate.shapes.choice import translate_shape
from comparisons.translate.shapes.plugins import Site

__all__ = ["Site", "flat", "meshes", "native", "quadrics", "tori", "translate_shape"]
