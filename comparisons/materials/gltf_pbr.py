"""glTF's metallic-roughness material, which Mitsuba lacks: our plugin `gltf_pbr`."""

from comparisons.materials.material import Gltf, MaterialType
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.plugin_table import NUMBER, PluginTable, Row
from comparisons.mitsuba.plugins.materials import GLTF_COLOURS, GLTF_NUMBERS
from comparisons.renderers.vocabulary import GltfWriter, Look, of_index
from comparisons.textures.kinds import COLOUR_OR_TEXTURE, NUMBER_OR_TEXTURE
from reference_rt.materials import GltfPbr

TABLE = PluginTable(
    "gltf_pbr",
    (
        Row("ior", "ior", NUMBER, 1.5),
        *(Row(name, name, COLOUR_OR_TEXTURE, 1.0) for name in GLTF_COLOURS),
        *(Row(name, name, NUMBER_OR_TEXTURE, 1.0) for name in GLTF_NUMBERS),
    ),
)


def _look(material: GltfPbr, name: str, writing: GltfWriter) -> Look:
    more = of_index(material.ior)
    if (material.specular, material.specular_color) != (1.0, (1.0, 1.0, 1.0)):
        if isinstance(material.specular, str) or isinstance(material.specular_color, str):
            raise UnwritableError("a textured strength or colour of the highlight")
        more["KHR_materials_specular"] = {
            "specularFactor": material.specular,
            "specularColorFactor": list(material.specular_color),
        }
    base, metallic, rough = material.base_color, material.metallic, material.roughness
    return Look(base, (1, 1, 1), metallic, rough, extensions=more)


GLTF_PBR = MaterialType(
    description=GltfPbr,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"gltf_pbr": TABLE.reader(GltfPbr)},
    note=lambda material, context: "Mitsuba has no glTF material: our plugin is used instead",
    errors=None,
    to_cycles=None,
    to_gltf=Gltf(_look),
    to_pbrt=None,
)
