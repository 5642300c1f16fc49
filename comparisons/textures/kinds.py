"""Kinds of a plugin's parameters that may be textures."""

from comparisons.mitsuba.plugin_table import Kind
from comparisons.textures.reading import colour_or_texture, number_or_texture
from comparisons.textures.translate import colour, number

COLOUR_OR_TEXTURE = Kind(colour, colour_or_texture)
NUMBER_OR_TEXTURE = Kind(number, number_or_texture, "a number or a texture")
