"""BSDFs of Mitsuba scenes, by name among the materials that have been read."""

from comparisons.materials import READERS
from comparisons.mitsuba.node import Node, Reading
from comparisons.textures.checker import FIELDS, fields_of, is_checker_of_textures
from reference_rt.materials import Blend, Material


def material_name(reading: Reading, node: Node) -> str:
    """The name of a BSDF among the materials of `reading`, which is read if it is not yet."""
    key = ("bsdf", node.index)
    if key not in reading.names:
        if node.plugin not in READERS:
            raise node.unsupported(f"expected one of: {', '.join(sorted(READERS))}")
        material = _of_checkers(reading, node)
        name = reading.unused(node.name, node.plugin, reading.materials)
        reading.materials[name] = material
        reading.names[key] = name
    return reading.names[key]


def _of_checkers(reading: Reading, node: Node) -> Material:
    """The material of a BSDF: where a checkerboard has textures for its fields, a blend of one
    material for each kind of field."""
    for texture in node.clone().children("Texture"):
        if texture.index in reading.fields or not is_checker_of_textures(texture):
            continue
        names = []
        for field in FIELDS:
            reading.fields[texture.index] = field
            part = _of_checkers(reading, node.clone())
            names.append(
                reading.unused(f"{node.name or node.plugin}_{field}", "", reading.materials)
            )
            reading.materials[names[-1]] = part
        del reading.fields[texture.index]
        weight = reading.unused(texture.name, texture.plugin, reading.textures)
        reading.textures[weight] = fields_of(texture)
        return Blend(first=names[0], second=names[1], weight=weight)
    with node.checking():
        material = READERS[node.plugin](reading, node)
    node.finish()
    return material
