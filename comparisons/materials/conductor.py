"""Smooth metals."""

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
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.renderers.vocabulary import (
    CyclesWriter,
    Data,
    Params,
    PbrtWriter,
    front,
    only,
)
from reference_rt.materials import Conductor, Material, Mirror

TABLE = PluginTable("conductor", METAL)


def _from_mitsuba(reading: Reading, node: Node) -> Material:
    values = read_metal(TABLE, reading, node)
    if max(values["eta"]) == 0.0:
        if min(values["k"]) > 0.0:
            return Mirror(reflectance=values["reflectance"])
        raise node.error("'eta' and 'k' are 0; expected an index of refraction")
    return Conductor(**without_zeros(values))


def _to_cycles(material: Conductor, writing: CyclesWriter) -> Data:
    only(material, reflectance=1.0)
    return front({**cycles_metal(material), "roughness": 0.0})


def _to_pbrt(material: Conductor, writing: PbrtWriter, both_sides: bool) -> Params:
    return pbrt_metal(pbrt_index(material), material, writing)


CONDUCTOR = MaterialType(
    description=Conductor,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"conductor": _from_mitsuba},
    note=None,
    errors=None,
    to_cycles=_to_cycles,
    to_gltf=Gltf(look_of_metal, nearly="a smooth metal of Schlick's reflectance"),
    to_pbrt=_to_pbrt,
)
