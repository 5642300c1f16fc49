"""The textbook's Phong shading, which Mitsuba lacks: our plugin `textbook_phong`."""

import numpy as np

from comparisons.materials.material import Gltf, MaterialType
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.plugin_table import FLAG, NUMBER, PluginTable, Row
from comparisons.renderers.vocabulary import GltfWriter, Look, matte
from comparisons.textures.kinds import COLOUR_OR_TEXTURE
from reference_rt.materials import Phong

TABLE = PluginTable(
    "textbook_phong",
    (
        *(
            Row(name, name, COLOUR_OR_TEXTURE, 0.0)
            for name in ("ambient", "diffuse", "specular", "mirror")
        ),
        Row("exponent", "exponent", NUMBER, 32.0),
        Row("half_vector", "half_vector", FLAG, False),
    ),
)


def _look(material: Phong, name: str, writing: GltfWriter) -> Look:
    if isinstance(material.diffuse, str):
        raise UnwritableError(f"a material '{material.type}'")
    seen = np.minimum(np.pi * np.array(material.diffuse), 1.0)
    return matte(tuple(seen.tolist()))


PHONG = MaterialType(
    description=Phong,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"textbook_phong": TABLE.reader(Phong)},
    note=lambda material, context: "Mitsuba has no Phong material: our plugin is used instead",
    errors=None,
    to_cycles=None,
    to_gltf=Gltf(_look, nearly="a matte surface"),
    to_pbrt=None,
)
