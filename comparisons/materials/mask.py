"""Masks, and surfaces that let all light pass."""

from typing import Any

from comparisons.materials.material import Gltf, MaterialType, nested
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable, Row
from comparisons.renderers.vocabulary import GltfWriter, Look
from comparisons.textures.kinds import NUMBER_OR_TEXTURE
from comparisons.textures.texture import Nested
from reference_rt.materials import Diffuse, Mask

TABLE = PluginTable("mask", (Row("opacity", "opacity", NUMBER_OR_TEXTURE, 0.5),))


def _to_mitsuba(material: Mask, context: TranslationContext) -> dict[str, Any]:
    values = {**TABLE.write(material, context), "base": Nested(material.base)}
    return values if context.native else values | {"type": "mixture_mask"}


def _from_mitsuba(reading: Reading, node: Node) -> Mask:
    values = TABLE.read(reading, node)
    (base,) = nested(reading, node, 1, 1)
    return Mask(base=base, **values)


BLACK = "black"
"""The name of the material that scatters nothing."""


def absent(reading: Reading) -> Mask:
    """A surface that lets all light pass."""
    if "black" not in reading.names:
        name = reading.unused(BLACK, BLACK, reading.materials)
        reading.materials[name] = Diffuse(reflectance=(0.0, 0.0, 0.0))
        reading.names["black"] = name
    return Mask(base=reading.names["black"], opacity=0.0)


def _look(material: Mask, name: str, writing: GltfWriter) -> Look:
    look = writing.look(material.base)
    look.opacity = material.opacity
    return look


MASK = MaterialType(
    description=Mask,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"mask": _from_mitsuba},
    note=lambda material, context: "shadow rays treat masks as opaque, in both renderers",
    errors=None,
    to_cycles=None,
    to_gltf=Gltf(_look),
    to_pbrt=None,
)
