"""Rough metals."""

from typing import Any

from comparisons.materials.material import Gltf, MaterialType
from comparisons.materials.metal import (
    METAL,
    cycles_metal,
    look_of_metal,
    pbrt_index,
    pbrt_metal,
    read_metal,
    without_zeros,
)
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
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    Params,
    PbrtWriter,
    front,
    only,
)
from reference_rt.materials import RoughConductor

TABLE = PluginTable("roughconductor", (DISTRIBUTION, *METAL), SAMPLING)


def _to_mitsuba(material: RoughConductor, context: TranslationContext) -> dict[str, Any]:
    return write_rough(TABLE, material, context)


def _from_mitsuba(reading: Reading, node: Node) -> RoughConductor:
    values = without_zeros(read_metal(TABLE, reading, node))
    return RoughConductor(**values, alpha=read_alpha(reading, node))


MOST_ALPHA = 0.15
"""Largest roughness of metals that vote.  Cycles' masking of microfacets is Smith's height-
correlated form, ours and Mitsuba's the separable one: at 60 degrees from the normal, both ways,
they differ by 0.03 % at this roughness (Lambda² / (1 + 2 Lambda) with Lambda = 0.017)."""


def _to_cycles(material: RoughConductor, writing: CyclesWriter) -> Data:
    only(material, reflectance=1.0, distribution="ggx")
    alphas = {material.alpha} if isinstance(material.alpha, str) else set(material.alpha)
    (alpha, *others) = alphas
    if others or isinstance(alpha, str) or alpha > MOST_ALPHA:
        raise NoCounterpartError(
            f"the material {material.type}, but for one alpha of at most {MOST_ALPHA:g}: Cycles' "
            "masking is height-correlated"
        )
    return front({**cycles_metal(material), "roughness": alpha**0.5})


def _to_pbrt(material: RoughConductor, writing: PbrtWriter, both_sides: bool) -> Params:
    return pbrt_metal({**pbrt_index(material), **pbrt_alpha(material, writing)}, material, writing)


ROUGH_CONDUCTOR = MaterialType(
    description=RoughConductor,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"roughconductor": _from_mitsuba},
    note=note_of_beckmann,
    errors=None,
    to_cycles=_to_cycles,
    to_gltf=Gltf(look_of_metal, nearly="a metal of Schlick's reflectance"),
    to_pbrt=_to_pbrt,
)
