"""Normal maps."""

from typing import Any

import numpy as np

from comparisons.materials.material import Gltf, MaterialType, nested
from comparisons.materials.tilted import TILT
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable, inserted
from comparisons.renderers.vocabulary import GltfWriter, Look
from comparisons.textures.bitmap import texels_of
from comparisons.textures.product import product
from comparisons.textures.reading import colour_or_texture
from comparisons.textures.texture import Nested
from comparisons.textures.translate import colour
from reference_rt.materials import Material, NormalMap
from reference_rt.textures import Bitmap

TABLE = PluginTable("normalmap", TILT)


def _to_mitsuba(material: NormalMap, context: TranslationContext) -> dict[str, Any]:
    texture = context.textures[material.normals]
    if not isinstance(texture, Bitmap) or texture.cutoff is not None:
        raise UntranslatableError("NormalMap of a texture that is no image", "material")
    if context.files is not None and (material.follow_v or material.scale != 1.0):
        raise UntranslatableError("NormalMap with 'scale' or 'follow_v'", "material")
    normals = colour(material.normals, context)
    if context.files is None:
        texels = texels_of(texture, context)
        undirected = np.all(texels == 0.5, axis=-1)
        # Mitsuba has NaN for a grey of 1/2, and no light; ours keeps the surface's normal.
        is_replaced = undirected.all() or (texture.filter == "nearest" and undirected.any())
        if material.scale != 1.0 or is_replaced:
            factors = np.array([material.scale, material.scale, 1.0])
            texels = texels * factors + 0.5 * (1.0 - factors)
            if is_replaced:
                texels[undirected] = (0.5, 0.5, 1.0)
            normals |= context.image(material.normals, texels)
    if material.follow_v:
        normals = product([normals], follow_v=True)
    more = {"normalmap": normals, "bsdf": Nested(material.base)}
    return inserted(TABLE.write(material, context), "type", more)


def _from_mitsuba(reading: Reading, node: Node) -> Material:
    (base,) = nested(reading, node, 1, 1)
    normals = colour_or_texture(reading, node, "normalmap", 0.5)
    options = TABLE.read(reading, node)
    if normals == (0.5, 0.5, 1.0):  # the surface's own normals: no law applies
        own: Material = reading.materials[base]
        return own
    if not isinstance(normals, str):
        raise node.error("'normalmap' is a colour, or not given; expected a texture")
    return NormalMap(base=base, normals=normals, **options)


def _note(material: NormalMap, context: TranslationContext) -> str:
    if material.flip_invalid_normals and material.use_shadowing_function:
        return ""
    return (
        "Mitsuba's bump and normal maps run with flip_invalid_normals and use_shadowing_function "
        "as the scene has them, not with both on as by default"
    )


def _look(material: NormalMap, name: str, writing: GltfWriter) -> Look:
    look = writing.look(material.base)
    look.normals = material
    return look


NORMAL_MAP = MaterialType(
    description=NormalMap,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"normalmap": _from_mitsuba},
    note=_note,
    errors=None,
    to_cycles=None,
    to_gltf=Gltf(_look),
    to_pbrt=None,
)
