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
from comparisons.mitsuba.files import Losses
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import EMISSION, PluginTable, Row
from reference_rt.lights import Ambient, Constant


def ambient_of(lights: tuple[Any, ...]) -> list[float]:
    """The summed radiance (R, G, B) of all ambient lights."""
    radiances = [light.radiance for light in lights if isinstance(light, Ambient)]
    return [float(x) for x in np.sum(radiances, axis=0)] if radiances else [0.0, 0.0, 0.0]


TABLE = PluginTable("constant", (Row("radiance", "radiance", EMISSION, 1.0),), ("to_world",))


def _from_mitsuba(reading: Reading, node: Node) -> Constant:
    return Constant(**TABLE.read(reading, node))


def leave_out_environment(light: Any, name: str, losses: Losses) -> None:
    """For `to_gltf`."""
    losses.note(f"the environment ({name}) is left out: renderers of glTF are given one beside it")


def _leave_out_ambient(light: Ambient, name: str, losses: Losses) -> None:
    losses.note("the ambient light is left out")


def _stays(light: Any, motion: Motion) -> Any:
    return light


CONSTANT = LightType(
    description=Constant,
    to_mitsuba=TABLE.write,
    from_mitsuba={"constant": _from_mitsuba},
    to_cycles=lambda light: {"type": "BACKGROUND", "colour": list(light.radiance)},
    to_gltf=leave_out_environment,
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
    to_mitsuba=None,
    from_mitsuba={},
    to_cycles=None,
    to_gltf=_leave_out_ambient,
    moved=_stays,
    at=None,
    along=None,
    surrounds=False,
    is_bounded=False,
    projects=shows_no_image,
    brightest=brightest_of("radiance"),
    float32=None,
)
