"""Smooth glass."""

from comparisons.materials.glass import GLASS, OF_FRESNEL, look_of_glass, pbrt_glass, relative_index
from comparisons.materials.material import Gltf, MaterialType
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import CyclesWriter, Data, PovLook, PovWriter, only
from reference_rt.materials import Dielectric

TABLE = PluginTable("dielectric", GLASS)


def _to_cycles(material: Dielectric, writing: CyclesWriter) -> Data:
    only(material, reflectance=1.0, transmittance=1.0)
    return {"type": "glass", "ior": relative_index(material), "roughness": 0.0}


def _to_povray(material: Dielectric, writing: PovWriter) -> PovLook:
    only(material, reflectance=1.0, transmittance=1.0, exterior_ior=1.0)
    if material.interior_ior <= 1.0:
        raise NoCounterpartError("glass whose index is not above 1")
    return PovLook(index=material.interior_ior)


DIELECTRIC = MaterialType(
    description=Dielectric,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"dielectric": TABLE.reader(Dielectric)},
    note=None,
    errors=OF_FRESNEL,
    to_cycles=_to_cycles,
    to_gltf=Gltf(look_of_glass, nearly="KHR_materials_transmission"),
    to_pbrt=lambda material, writing, both_sides: pbrt_glass("dielectric", material),
    to_povray=_to_povray,
)
