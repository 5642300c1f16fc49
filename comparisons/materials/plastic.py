"""Smooth plastics."""

from typing import Any

from comparisons.materials.coat import (
    COAT,
    PASSED,
    base_off,
    look_of_coat,
    of_vertices,
    write_coated,
)
from comparisons.materials.glass import OF_FRESNEL, relative_index
from comparisons.materials.material import Errors, Gltf, MaterialType
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.plugin_table import PluginTable
from reference_rt.materials import Plastic

TABLE = PluginTable("plastic", COAT)


def _to_mitsuba(material: Plastic, context: TranslationContext) -> dict[str, Any]:
    return write_coated(TABLE, material, context, {})


def _note(material: Plastic, context: TranslationContext) -> str:
    eta = relative_index(material)
    off = base_off(eta)
    return (
        f"Mitsuba's fit of a coat's internal reflectance, which makes the base {off} at a relative "
        f"index of {eta:.4g}, is replaced by the integral{of_vertices(material, context)}"
    )


PLASTIC = MaterialType(
    description=Plastic,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"plastic": TABLE.reader(Plastic)},
    note=_note,
    errors=Errors(relative=OF_FRESNEL.relative, absolute=lambda material: PASSED),
    to_cycles=None,
    to_gltf=Gltf(look_of_coat, nearly="a diffuse base below a highlight"),
    to_pbrt=None,
)
