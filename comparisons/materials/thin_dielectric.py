"""Panes of glass."""

from comparisons.materials.glass import GLASS, OF_FRESNEL, look_of_glass, pbrt_glass
from comparisons.materials.material import Gltf, MaterialType
from comparisons.mitsuba.plugin_table import PluginTable
from reference_rt.materials import ThinDielectric

TABLE = PluginTable("thindielectric", GLASS)

THIN_DIELECTRIC = MaterialType(
    description=ThinDielectric,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"thindielectric": TABLE.reader(ThinDielectric)},
    note=None,
    errors=OF_FRESNEL,
    to_cycles=None,
    to_gltf=Gltf(look_of_glass, nearly="KHR_materials_transmission"),
    to_pbrt=lambda material, writing, both_sides: pbrt_glass("thindielectric", material),
)
