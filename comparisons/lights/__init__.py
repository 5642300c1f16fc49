"""Lights for the comparison: to and from Mitsuba, to Cycles and glTF, and what bounds of their
errors need; a file per type, whose contract is `LightType`.

To add a type: its file here, and a line in `LIGHTS`.
"""

from typing import Any

from comparisons.lights.constant import AMBIENT, CONSTANT
from comparisons.lights.directional import DIRECTIONAL
from comparisons.lights.environment_map import ENVIRONMENT_MAP
from comparisons.lights.goniometric import GONIOMETRIC
from comparisons.lights.light import Data, LightType
from comparisons.lights.point import POINT
from comparisons.lights.projector import PROJECTOR
from comparisons.lights.spot import SPOT
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.node import Node, Reading

LIGHTS: tuple[LightType[Any], ...] = (
    POINT,
    SPOT,
    GONIOMETRIC,
    PROJECTOR,
    DIRECTIONAL,
    CONSTANT,
    ENVIRONMENT_MAP,
    AMBIENT,
)
"""All types of lights that are no shapes."""

BY_TYPE = {one.description: one for one in LIGHTS}

_BY_PLUGIN = {plugin: read for one in LIGHTS for plugin, read in one.from_mitsuba.items()}


def type_of(light: Any) -> LightType[Any]:
    """What is known of a light's type.  Raises UntranslatableError for one not in LIGHTS."""
    found = BY_TYPE.get(type(light))
    if found is None:
        raise UntranslatableError(light, "light")
    return found


def translate_light(light: Any, context: TranslationContext) -> Data | None:
    """An emitter's dict; None for ambient light, see `ambient_of`.

    Raises UntranslatableError, ValueError for a file that cannot be used.
    """
    to_mitsuba = type_of(light).to_mitsuba
    return None if to_mitsuba is None else to_mitsuba(light, context)


def read_light(reading: Reading, node: Node) -> None:
    """Add an emitter that belongs to no shape.  Raises SceneError."""
    if node.plugin not in _BY_PLUGIN:
        known = ", ".join(sorted(_BY_PLUGIN))
        raise node.unsupported(f"expected one of: {known}, or area in shapes")
    node.ignore("sampling_weight")
    node.children("Medium")  # of particles from it, which no integrator of ours follows in media
    with node.checking():
        light = _BY_PLUGIN[node.plugin](reading, node)
    node.finish()
    reading.lights.append(light)
