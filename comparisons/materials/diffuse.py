"""Diffuse materials: Lambert's law in every renderer."""

from comparisons.materials.material import Gltf, MaterialType
from comparisons.mitsuba.plugin_table import PluginTable, Row
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    Params,
    PbrtWriter,
    PovLook,
    PovWriter,
    front,
    matte,
)
from comparisons.textures.kinds import COLOUR_OR_TEXTURE
from reference_rt.materials import Diffuse

TABLE = PluginTable("diffuse", (Row("reflectance", "reflectance", COLOUR_OR_TEXTURE, 0.5),))


def _to_cycles(material: Diffuse, writing: CyclesWriter) -> Data:
    return front({"type": "diffuse", "colour": writing.colour(material.reflectance)})


def _to_pbrt(material: Diffuse, writing: PbrtWriter, both_sides: bool) -> Params:
    colour = writing.parameter("rgb", "reflectance", material.reflectance)
    return {"string type": "diffuse", **colour}


def _to_povray(material: Diffuse, writing: PovWriter) -> PovLook:
    return PovLook(material.reflectance, diffuse=1.0)


DIFFUSE = MaterialType(
    description=Diffuse,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"diffuse": TABLE.reader(Diffuse)},
    note=None,
    errors=None,
    to_cycles=_to_cycles,
    to_gltf=Gltf(lambda material, name, writing: matte(material.reflectance)),
    to_pbrt=_to_pbrt,
    to_povray=_to_povray,
)
