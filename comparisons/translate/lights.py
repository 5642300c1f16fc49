"""Lights that are not shapes."""

from functools import singledispatch
from typing import Any

from comparisons.translate.errors import UntranslatableError
from comparisons.translate.materials import rgb
from reference_rt.lights import Constant, Point


@singledispatch
def translate_light(light: Any) -> dict[str, Any]:
    """An emitter's dict.  Raises UntranslatableError."""
    raise UntranslatableError(light, "light")


@translate_light.register
def _(light: Point) -> dict[str, Any]:
    return {
        "type": "point",
        "position": list(light.position),
        "intensity": rgb(light.intensity),
    }


@translate_light.register
def _(light: Constant) -> dict[str, Any]:
    return {"type": "constant", "radiance": rgb(light.radiance)}
