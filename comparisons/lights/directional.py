"""Parallel light: Mitsuba's `directional`."""

import numpy as np

from comparisons.lights.light import (
    Data,
    LightType,
    Motion,
    Punctual,
    across,
    brightest_of,
    by_column,
    check_size,
    shows_no_image,
)
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import EMISSION, VECTOR, PluginTable, Row
from comparisons.renderers.vocabulary import GltfWriter, Params, PbrtWriter, pov_vector
from reference_rt.lights import Directional

TABLE = PluginTable(
    "directional",
    (
        Row("direction", "direction", VECTOR, (0.0, 0.0, 1.0)),
        Row("irradiance", "irradiance", EMISSION, 1.0),
    ),
)


def _from_mitsuba(reading: Reading, node: Node) -> Directional:
    axis = by_column(node, "direction", 2)
    for given in axis.values():
        check_size(node, np.array(given))
    return Directional(**TABLE.read(reading, node) | axis)


def _to_cycles(light: Directional) -> Data:
    """A sun shines along its -z."""
    back = -np.array(light.direction) / np.linalg.norm(light.direction)
    aside = np.cross(back, across(back))
    aside /= np.linalg.norm(aside)
    axes = np.column_stack([aside, np.cross(back, aside), back, np.zeros(3)])
    return {"type": "SUN", "colour": list(light.irradiance), "matrix": axes.tolist()}


def _to_gltf(light: Directional, name: str, writing: GltfWriter) -> Punctual:
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    return Punctual(light.irradiance, axis=axis)


def _to_pbrt(light: Directional, writing: PbrtWriter) -> tuple[str, Params]:
    place = {"point3 from": (0.0, 0.0, 0.0), "point3 to": light.direction}
    return "distant", {"rgb L": light.irradiance, **place}


FAR = 1e4
"""Where parallel light begins, beyond all shapes."""


def _to_povray(light: Directional) -> str:
    way = np.array(light.direction) / np.linalg.norm(light.direction)
    colour = pov_vector(np.array(light.irradiance) / np.pi)
    return f"light_source {{ {pov_vector(-FAR * way)}, rgb {colour} parallel point_at <0,0,0> }}"


def _moved(light: Directional, motion: Motion) -> Directional:
    return light.model_copy(update={"direction": motion.direction(light.direction)})


DIRECTIONAL = LightType(
    description=Directional,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"directional": _from_mitsuba},
    to_cycles=_to_cycles,
    to_gltf=_to_gltf,
    to_pbrt=_to_pbrt,
    to_povray=_to_povray,
    moved=_moved,
    at=None,
    along=lambda light: light.direction,
    surrounds=False,
    is_bounded=False,
    projects=shows_no_image,
    brightest=brightest_of("irradiance"),
    float32=None,
)
