"""Textures: one type, one file, with all that the comparison knows of it (`texture.TextureType`).

`translate` and `reading` are parameters that may be textures, to and from Mitsuba; `kinds` has both
for tables of plugins.  To add a type: its file, and a member of TEXTURES.
"""

from comparisons.textures.bitmap import BITMAP
from comparisons.textures.checker import CHECKER
from comparisons.textures.product import PRODUCT
from comparisons.textures.texture import TextureType
from comparisons.textures.vertex_colours import VERTEX_COLOURS

TEXTURES = (BITMAP, CHECKER, PRODUCT, VERTEX_COLOURS)
"""All types of textures."""

BY_DESCRIPTION = {one.description: one for one in TEXTURES}
"""By our type."""

READERS = {plugin: read for one in TEXTURES for plugin, read in one.from_mitsuba.items()}
"""By Mitsuba's plugin, what reads it."""

__all__ = ["BY_DESCRIPTION", "READERS", "TEXTURES", "TextureType"]
