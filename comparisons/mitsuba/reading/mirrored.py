"""Cameras that mirror the picture, which ours do not: the whole scene is mirrored instead.

The picture of a scene by a camera M (a map from its own coordinates to the world's) is that of the
mirrored scene by the camera W M, for any mirroring map W; and W M mirrors no more.  Our shapes stay
what they are under a map that mirrors: their front stays the front, and their uv stay.
"""

from typing import Any

import numpy as np

from comparisons.mitsuba.reading.context import Reading
from comparisons.mitsuba.reading.node import Node
from reference_rt.lights import Constant, Directional, EnvironmentMap, Point, Projector, Spot
from reference_rt.materials import NormalMap

MIRROR = np.diag([-1.0, 1.0, 1.0])
"""W: x becomes -x."""

_STEP = {"matrix": np.column_stack([MIRROR, np.zeros(3)]).tolist()}


def mirror_scene(reading: Reading, node: Node) -> None:
    """Mirror the shapes and lights of `reading` for the sensor `node`.  Raises SceneError."""
    for name, material in reading.materials.items():
        if isinstance(material, NormalMap):
            # Their green is along n x dp/du, which a mirror reverses.
            raise node.error(
                "'to_world' mirrors the picture, which is not supported together with normal maps "
                f"('{name}'); expected a rotation: mirror the picture instead"
            )
    if any(isinstance(x, Projector) or getattr(x, "texture", None) for x in reading.lights):
        raise node.error(
            "'to_world' mirrors the picture, which is not supported together with lights that "
            "project images; expected a rotation: mirror the picture instead"
        )
    reading.shapes = [_moved(shape) for shape in reading.shapes]
    reading.lights = [_light(light) for light in reading.lights]
    reading.note(
        node,
        "'to_world' mirrors the picture, which our cameras do not: the whole scene is mirrored "
        "instead, x being -x",
    )


def _moved(part: Any) -> Any:
    """A shape or an environment map under one more step."""
    steps = tuple(step.model_dump() for step in part.transform)
    fields = {name: getattr(part, name) for name in part.model_fields_set}
    return type(part)(**fields | {"transform": (*steps, _STEP)})


def _light(light: Any) -> Any:
    match light:
        case Point():
            return _with(light, "position")
        case Spot():
            return _with(light, "origin", "target")
        case Directional():
            return _with(light, "direction")
        case EnvironmentMap():
            return _moved(light)
        case Constant():
            return light
    raise TypeError(f"no mirror image of {type(light).__name__}")


def _with(light: Any, *vectors: str) -> Any:
    """A light with mirrored vectors."""
    update = {name: tuple((MIRROR @ getattr(light, name)).tolist()) for name in vectors}
    return light.model_copy(update=update)
