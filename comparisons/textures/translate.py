"""Parameters that may be textures -> Mitsuba, in memory and in scene files."""

from typing import Any

from comparisons.mitsuba.context import TranslationContext, UntranslatableError, rgb
from comparisons.textures import type_of
from comparisons.textures.texture import Nested, Use, uv_attribute
from reference_rt.textures import Product, Texture, VertexColours


def colour(value: tuple[float, float, float] | str, context: TranslationContext) -> dict[str, Any]:
    """A colour, or the texture with that name.  Raises UntranslatableError, ValueError for a file
    that cannot be used."""
    return _colour(value, context, Use())


def projected(
    value: tuple[float, float, float] | str, context: TranslationContext
) -> dict[str, Any]:
    """The same for a light that projects it: Mitsuba's v is 0 at the top of such an image."""
    return _colour(value, context, Use(projected=True))


def _colour(value: Any, context: TranslationContext, use: Use) -> dict[str, Any]:
    if isinstance(value, str):
        return translate_texture(context.textures[value], value, context, use)
    return rgb(value)


def number(value: float | str, context: TranslationContext) -> float | dict[str, Any]:
    """A number, or the luminance of the texture with that name.

    Mitsuba gets one channel with our luminance: its own weights have other digits (0.212671 for
    0.2126).  Raises as `colour` does.
    """
    if isinstance(value, str):
        return translate_texture(context.textures[value], value, context, Use(as_number=True))
    return value


def translate_texture(
    texture: Texture, name: str, context: TranslationContext, use: Use
) -> dict[str, Any]:
    """The dictionary of a texture.  Raises as `colour` does."""
    translated = type_of(texture).to_mitsuba(texture, name, context, use)
    nested = Use(projected=use.projected)
    found = {
        key: _colour(part.name, context, nested) if isinstance(part, Nested) else part
        for key, part in translated.items()
    }
    if texture.uv_set and not isinstance(texture, Product | VertexColours):
        if context.files is not None:
            kind = f"{type(texture).__name__} with 'uv_set: {texture.uv_set}'"
            raise UntranslatableError(kind, "texture")
        attribute = uv_attribute(texture.uv_set)
        found = {"type": "texture_of_set", "attribute": attribute, "of": found}
    return found


def depends_on_uv(texture: Texture) -> bool:
    """Whether the texture depends on a surface's uv."""
    return not isinstance(texture, VertexColours)
