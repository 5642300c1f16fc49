"""Rough glass."""

from typing import Any

from comparisons.materials.glass import GLASS, OF_FRESNEL, look_of_glass, pbrt_glass
from comparisons.materials.material import Gltf, MaterialType
from comparisons.materials.microfacets import (
    DISTRIBUTION,
    SAMPLING,
    note_of_beckmann,
    pbrt_alpha,
    read_alpha,
    write_rough,
)
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.renderers.vocabulary import Params, PbrtWriter
from reference_rt.materials import RoughDielectric

TABLE = PluginTable("roughdielectric", (DISTRIBUTION, *GLASS), SAMPLING)


def _to_mitsuba(material: RoughDielectric, context: TranslationContext) -> dict[str, Any]:
    return write_rough(TABLE, material, context)


def _from_mitsuba(reading: Reading, node: Node) -> RoughDielectric:
    return RoughDielectric(**TABLE.read(reading, node), alpha=read_alpha(reading, node))


def _to_pbrt(material: RoughDielectric, writing: PbrtWriter, both_sides: bool) -> Params:
    return {**pbrt_glass("dielectric", material), **pbrt_alpha(material, writing)}


ROUGH_DIELECTRIC = MaterialType(
    description=RoughDielectric,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"roughdielectric": _from_mitsuba},
    note=note_of_beckmann,
    errors=OF_FRESNEL,
    to_cycles=None,
    to_gltf=Gltf(look_of_glass, nearly="KHR_materials_transmission"),
    to_pbrt=_to_pbrt,
)
