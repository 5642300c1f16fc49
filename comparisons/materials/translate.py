"""Materials of a scene -> Mitsuba: the BSDF and the emitter of a shape."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from comparisons.materials import type_of
from comparisons.mitsuba.context import TranslationContext
from comparisons.textures.texture import Nested
from comparisons.textures.translate import colour, depends_on_uv
from reference_rt.materials import Diffuse, Emissive, Material
from reference_rt.textures import VertexColours, texture_names


def translate_material(material: Material, context: TranslationContext) -> dict[str, Any]:
    """A BSDF's dictionary, with those of the materials that it is made of.  Raises
    UntranslatableError, ValueError for a file that cannot be used."""
    translated = type_of(material).to_mitsuba(material, context)
    if isinstance(translated, Nested):
        return translate_material(context.materials[translated.name], context)
    return {
        key: translate_material(context.materials[part.name], context)
        if isinstance(part, Nested)
        else part
        for key, part in translated.items()
    }


def parts_of(name: str | None, context: TranslationContext) -> dict[str, Any]:
    """The parts of a shape with material `name`: "bsdf" and, if it is emissive, "emitter".

    Raises as `translate_material` does.
    """
    material: Material = Diffuse() if name is None else context.materials[name]
    parts = {"bsdf": translate_material(material, context)}
    if isinstance(material, Emissive):
        radiance = colour(material.radiance, context)
        parts["emitter"] = {"type": "area", "radiance": radiance}
    return parts


def coloured_parts_of(name: str | None, context: TranslationContext) -> dict[str, Any] | None:
    """The same for a mesh with vertex colours; None if no texture uses them."""
    if not any(isinstance(texture, VertexColours) for texture in context.textures.values()):
        return None
    return parts_of(name, replace(context, has_colours=True))


def is_textured(name: str | None, context: TranslationContext) -> bool:
    """Whether material `name` depends on a surface's uv or tangents."""

    def has_uv(material: Material) -> bool:
        names = texture_names(material).values()
        return any(depends_on_uv(context.textures[t]) for t in names)

    return is_oriented(name, context) or _any_part(name, context, has_uv)


def is_oriented(name: str | None, context: TranslationContext) -> bool:
    """Whether material `name` depends on a surface's tangents."""
    return _any_part(name, context, lambda material: material.oriented)


def _any_part(
    name: str | None, context: TranslationContext, test: Callable[[Material], bool]
) -> bool:
    """Whether a material, or one that is nested in it, passes a test."""
    if name is None:
        return False
    material = context.materials[name]
    inner = [getattr(material, field) for field in getattr(material, "bases", ())]
    if isinstance(material, Emissive):
        inner = [material.base]
    return test(material) or any(_any_part(base, context, test) for base in inner)
