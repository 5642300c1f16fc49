"""Mirrors: Mitsuba's conductor without a material, which `conductor` reads."""

from comparisons.materials.material import Gltf, MaterialType
from comparisons.materials.metal import REFLECTANCE, pbrt_metal
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    Look,
    Params,
    PbrtWriter,
    PovLook,
    PovWriter,
    front,
)
from reference_rt.materials import Mirror

TABLE = PluginTable("conductor", (REFLECTANCE,))
"""Without a material Mitsuba's conductor has eta = 0, k = 1, and reflects everything."""


def _to_cycles(material: Mirror, writing: CyclesWriter) -> Data:
    return front({"type": "glossy", "colour": writing.colour(material.reflectance)})


EXTINCTION = 1e4
"""Of the metal that stands for a mirror, which pbrt lacks: its index is 1, so that it loses
4 / EXTINCTION² of the light, and not more than that over the cosine at grazing angles."""


def _to_pbrt(material: Mirror, writing: PbrtWriter, both_sides: bool) -> Params:
    index = {"rgb eta": (1.0,) * 3, "rgb k": (EXTINCTION,) * 3}
    return pbrt_metal(index, material, writing)


def _to_povray(material: Mirror, writing: PovWriter) -> PovLook:
    if isinstance(material.reflectance, str):
        raise NoCounterpartError("a mirror with a texture")
    return PovLook(mirror=material.reflectance)


MIRROR = MaterialType(
    description=Mirror,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={},
    note=None,
    errors=None,
    to_cycles=_to_cycles,
    to_gltf=Gltf(
        lambda material, name, writing: Look(material.reflectance, metallic=1.0, roughness=0.0),
        nearly="a smooth metal, white at grazing angles",
    ),
    to_pbrt=_to_pbrt,
    to_povray=_to_povray,
)
