"""Vertex colours: attributes of Mitsuba's meshes."""

from typing import Any

from comparisons.mitsuba.context import TranslationContext, rgb
from comparisons.mitsuba.node import Node, Reading
from comparisons.textures.texture import TextureType, Use
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.textures import VertexColours

VERTEX_COLOUR, VERTEX_LUMINANCE = "vertex_color", "vertex_luminance"
"""Names of mesh attributes."""


def _to_mitsuba(
    texture: VertexColours, name: str, context: TranslationContext, use: Use
) -> dict[str, Any]:
    if not context.has_colours:
        if use.as_number:
            return {"type": "uniform", "value": float(luminance(Vec3(*texture.without)))}
        return rgb(texture.without)
    # Files of meshes have no luminance: Mitsuba takes that of the colour.
    in_memory = context.files is None
    attribute = VERTEX_LUMINANCE if use.as_number and in_memory else VERTEX_COLOUR
    return {"type": "mesh_attribute", "name": attribute, "scale": texture.scale}


def _from_mitsuba(reading: Reading, node: Node, use: Use) -> VertexColours:
    name = str(node.properties.get("name", ""))
    if not name.startswith(("vertex_", "face_")):
        raise node.error(f"'name' is '{name}'; expected vertex_... or face_...")
    return VertexColours(scale=node.number("scale", 1.0))


VERTEX_COLOURS = TextureType(
    description=VertexColours,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"mesh_attribute": _from_mitsuba},
    to_cycles=None,
    to_gltf=None,  # no image: `comparisons.gltf.surfaces` has them as a factor
    to_pbrt=None,
)
