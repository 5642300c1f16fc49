"""The textbook's Phong shading, which Mitsuba lacks: our plugin `textbook_phong`."""

import math

import numpy as np

from comparisons.materials.material import Gltf, MaterialType
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.plugin_table import FLAG, NUMBER, PluginTable, Row
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import GltfWriter, Look, PovLook, PovWriter, matte
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


def _to_povray(material: Phong, writing: PovWriter) -> PovLook:
    """Its highlight has one strength for all channels, and its ambient light the diffuse colour."""
    if isinstance(material.specular, str) or len(set(material.specular)) > 1:
        raise NoCounterpartError("a highlight of Phong's that is coloured")
    if isinstance(material.mirror, str):
        raise NoCounterpartError("a mirror with a texture")
    diffuse, ambient = material.diffuse, material.ambient
    if ambient == diffuse:
        share: tuple[float, ...] = (1.0, 1.0, 1.0)
    elif isinstance(ambient, str) or (isinstance(diffuse, str) and any(ambient)):
        raise NoCounterpartError("a texture of ambient light that is not that of diffuse light")
    elif isinstance(diffuse, str):
        share = (0.0, 0.0, 0.0)
    elif any(a > 0.0 and d == 0.0 for a, d in zip(ambient, diffuse, strict=True)):
        raise NoCounterpartError("ambient light in a channel without diffuse light")
    else:
        share = tuple(a and a / d for a, d in zip(ambient, diffuse, strict=True))
    word, strength = "specular" if material.half_vector else "phong", material.specular[0]
    highlight = (word, math.pi * strength, material.exponent) if strength else None
    return PovLook(diffuse, math.pi, share, highlight, material.mirror)


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
    to_povray=_to_povray,
)
