"""Textures: one type, one file, with all that the comparison knows of it (`texture.TextureType`).

`translate` and `reading` are parameters that may be textures, to and from Mitsuba; `kinds` has both
for tables of plugins.  To add a type: its file, and a member of TEXTURES.
"""

from comparisons.mitsuba.context import UntranslatableError
from comparisons.textures.bitmap import BITMAP
from comparisons.textures.checker import CHECKER
from comparisons.textures.product import PRODUCT
from comparisons.textures.texture import TextureType
from comparisons.textures.vertex_colours import VERTEX_COLOURS
from reference_rt.textures import Texture

TEXTURES = (BITMAP, CHECKER, PRODUCT, VERTEX_COLOURS)
"""All types of textures."""

_BY_DESCRIPTION = {one.description: one for one in TEXTURES}

READERS = {plugin: read for one in TEXTURES for plugin, read in one.from_mitsuba.items()}
"""By Mitsuba's plugin, what reads it."""


def type_of(texture: Texture) -> TextureType:
    """What is known of a texture's type.  Raises UntranslatableError for one not in TEXTURES."""
    if type(texture) not in _BY_DESCRIPTION:
        raise UntranslatableError(texture, "texture")
    return _BY_DESCRIPTION[type(texture)]


__all__ = ["READERS", "TEXTURES", "TextureType", "type_of"]
