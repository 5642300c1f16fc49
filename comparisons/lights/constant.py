"""The same radiance from all directions: Mitsuba's `constant`; and ambient light, which Whitted's
ray tracing adds everywhere and which is a parameter of our plugin."""

from typing import Any

import numpy as np

from comparisons.lights.light import (
    LightType,
    Motion,
    brightest_of,
    shows_no_image,
)
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import EMISSION, PluginTable, Row
from comparisons.renderers.vocabulary import GltfWriter, pov_vector
from reference_rt.lights import Ambient, Constant


def ambient_of(lights: tuple[Any, ...]) -> list[float]:
    """The summed radiance (R, G, B) of all ambient lights."""
    radiances = [light.radiance for light in lights if isinstance(light, Ambient)]
    return [float(x) for x in np.sum(radiances, axis=0)] if radiances else [0.0, 0.0, 0.0]


TABLE = PluginTable("constant", (Row("radiance", "radiance", EMISSION, 1.0),), ("to_world",))


def _from_mitsuba(reading: Reading, node: Node) -> Constant:
    return Constant(**TABLE.read(reading, node))


def leave_out_environment(light: Any, name: str, writing: GltfWriter) -> None:
    """For `to_gltf`."""
    writing.note(f"the environment ({name}) is left out: renderers of glTF are given one beside it")


def _leave_out_ambient(light: Ambient, name: str, writing: GltfWriter) -> None:
    writing.note("the ambient light is left out")


def _stays(light: Any, motion: Motion) -> Any:
    return light


CONSTANT = LightType(
    description=Constant,
    table=TABLE,
    to_mitsuba=TABLE.write,
    from_mitsuba={"constant": _from_mitsuba},
    to_cycles=lambda light: {"type": "BACKGROUND", "colour": list(light.radiance)},
    to_gltf=leave_out_environment,
    to_pbrt=lambda light, writing: ("infinite", {"rgb L": light.radiance}),
    to_povray=lambda light: f"background {{ rgb {pov_vector(light.radiance)} }}",
    moved=_stays,
    at=None,
    along=None,
    surrounds=True,
    is_bounded=False,
    projects=shows_no_image,
    brightest=brightest_of("radiance"),
    float32=None,
)

AMBIENT = LightType(
    description=Ambient,
    table=None,
    to_mitsuba=None,
    from_mitsuba={},
    to_cycles=None,
    to_gltf=_leave_out_ambient,
    to_pbrt=lambda light, writing: None,
    to_povray=lambda light: "",
    moved=_stays,
    at=None,
    along=None,
    surrounds=False,
    is_bounded=False,
    projects=shows_no_image,
    brightest=brightest_of("radiance"),
    float32=None,
)
