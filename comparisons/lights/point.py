"""Point lights: Mitsuba's `point`."""

import math

import numpy as np

from comparisons.lights.light import (
    Data,
    LightType,
    Motion,
    Punctual,
    brighter,
    brightest_of,
    by_column,
    shows_no_image,
)
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import EMISSION, VECTOR, PluginTable, Row
from comparisons.renderers.vocabulary import GltfWriter, Params, PbrtWriter, pov_vector
from reference_rt.lights import Point

TABLE = PluginTable(
    "point",
    (
        Row("position", "position", VECTOR, (0.0, 0.0, 0.0)),
        Row("intensity", "intensity", EMISSION, 1.0),
    ),
)


def _from_mitsuba(reading: Reading, node: Node) -> Point:
    place = by_column(node, "position", 3)
    return Point(**TABLE.read(reading, node) | place)


def _to_cycles(light: Point) -> Data:
    """Watts are 4 pi times the radiant intensity."""
    place = np.column_stack([np.eye(3), light.position])
    watts = [4.0 * math.pi * x for x in light.intensity]
    return {"type": "POINT", "colour": watts, "matrix": place.tolist()}


def _to_gltf(light: Point, name: str, writing: GltfWriter) -> Punctual:
    return Punctual(light.intensity, light.position)


def _to_pbrt(light: Point, writing: PbrtWriter) -> tuple[str, Params]:
    return "point", {"rgb I": light.intensity, "point3 from": light.position}


NEAR = 1e-3
"""Distance at which POV-Ray's attenuation, 2 / (1 + (d / NEAR)²), turns: far below all others."""


def _to_povray(light: Point) -> str:
    colour = np.array(light.intensity) / (2.0 * NEAR * NEAR * math.pi)
    fades = f"fade_distance {NEAR!r} fade_power 2"
    return f"light_source {{ {pov_vector(light.position)}, rgb {pov_vector(colour)} {fades} }}"


def _moved(light: Point, motion: Motion) -> Point:
    there = {"position": motion.point(light.position)}
    return light.model_copy(update=there | {"intensity": brighter(light.intensity, motion)})


POINT = LightType(
    description=Point,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"point": _from_mitsuba},
    to_cycles=_to_cycles,
    to_gltf=_to_gltf,
    to_pbrt=_to_pbrt,
    to_povray=_to_povray,
    moved=_moved,
    at=lambda light: light.position,
    along=None,
    surrounds=False,
    is_bounded=False,
    projects=shows_no_image,
    brightest=brightest_of("intensity"),
    float32=None,
)
