"""Bump maps, of which Mitsuba's own is wrong in places: our plugin `exact_bump`."""

from typing import Any

from comparisons.geometry import affine
from comparisons.materials.material import Gltf, MaterialType, nested
from comparisons.materials.tilted import TILT
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import NUMBER, PluginTable, Row, inserted
from comparisons.renderers.vocabulary import GltfWriter, Look
from comparisons.textures.reading import texture_name
from comparisons.textures.texture import Nested, Use
from comparisons.textures.translate import number, translate_texture
from reference_rt.materials import Bump
from reference_rt.textures import Bitmap
from reference_rt.textures.texture import UvMap

TABLE = PluginTable("bumpmap", (Row("scale", "scale", NUMBER, 1.0), *TILT))


def _to_mitsuba(material: Bump, context: TranslationContext) -> dict[str, Any] | Nested:
    texture = context.textures[material.height]
    if not isinstance(texture, Bitmap) or texture.filter != "bilinear" or texture.cutoff:
        return Nested(material.base)  # no slopes
    values = TABLE.write(material, context)
    if context.native:
        return inserted(
            values,
            "scale",
            {"height": number(material.height, context), "bsdf": Nested(material.base)},
        )
    upright = texture.model_copy(update={"uv": UvMap()})
    names = ("u_u", "u_v", "u_1", "v_u", "v_v", "v_1")
    more = {
        "height": translate_texture(upright, material.height, context, Use(as_number=True)),
        "base": Nested(material.base),
        **dict(zip(names, affine.of_uv(texture.uv)[:2].ravel().tolist(), strict=True)),
    }
    return inserted(values, "scale", more) | {"type": "exact_bump"}


def _from_mitsuba(reading: Reading, node: Node) -> Bump:
    (base,) = nested(reading, node, 1, 1)
    texture = node.only("Texture")
    if texture is None:
        raise node.error("has no texture; expected one")
    height = texture_name(reading, texture, Use(as_number=True))
    return Bump(base=base, height=height, **TABLE.read(reading, node))


def _look(material: Bump, name: str, writing: GltfWriter) -> Look:
    writing.note(f"the bumps of the material '{name}' are left out")
    return writing.look(material.base)


def _note(material: Bump, context: TranslationContext) -> str:
    return (
        "Mitsuba's bump maps are wrong over anisotropic materials and by rotated images that are "
        "not square, and not a number where they are flat and the tangent is exactly the z axis: "
        "our plugin is used instead"
    )


BUMP = MaterialType(
    description=Bump,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"bumpmap": _from_mitsuba},
    note=_note,
    errors=None,
    to_cycles=None,
    to_gltf=Gltf(_look),
    to_pbrt=None,
)
