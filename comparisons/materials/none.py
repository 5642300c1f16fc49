"""Boundaries without a surface: Mitsuba's `null`, where its integrator follows media."""

from comparisons.materials.mask import absent
from comparisons.materials.material import MaterialType
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import PluginTable
from comparisons.renderers.vocabulary import Params, PbrtWriter
from reference_rt.materials import Mask, NoSurface

TABLE = PluginTable("null")


def _from_mitsuba(reading: Reading, node: Node) -> NoSurface | Mask:
    """To Mitsuba's integrators without media it is a surface that lets all light pass: shadow rays
    end there, and it counts as an edge of a path."""
    return NoSurface() if reading.follows_media else absent(reading)


def _to_pbrt(material: NoSurface, writing: PbrtWriter, both_sides: bool) -> Params:
    return {"string type": "interface"}


NO_SURFACE = MaterialType(
    description=NoSurface,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"null": _from_mitsuba},
    note=None,
    errors=None,
    to_cycles=lambda material, writing: {"type": "clear"},
    to_gltf=None,
    to_pbrt=_to_pbrt,
)
