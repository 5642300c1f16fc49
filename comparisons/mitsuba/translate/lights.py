"""Lights that are not shapes."""

from functools import singledispatch
from typing import Any

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.translate.errors import UntranslatableError
from comparisons.mitsuba.translate.textures import Surroundings, rgb
from reference_rt.lights import Ambient, Constant, Directional, EnvironmentMap, Point, Spot


@singledispatch
def translate_light(light: Any, around: Surroundings) -> dict[str, Any] | None:
    """An emitter's dict; None for what Mitsuba has no place for: see `ambient_of`.

    Raises UntranslatableError, ValueError for a file that cannot be used.
    """
    raise UntranslatableError(light, "light")


@translate_light.register
def _(light: Point, around: Surroundings) -> dict[str, Any]:
    return {
        "type": "point",
        "position": list(light.position),
        "intensity": rgb(light.intensity),
    }


@translate_light.register
def _(light: Spot, around: Surroundings) -> dict[str, Any]:
    beam = 0.75 * light.cutoff_angle if light.beam_width is None else light.beam_width
    axis = np.subtract(light.target, light.origin)
    # Any that is not along the axis: the light is the same all round.
    up = np.eye(3)[int(np.argmin(np.abs(axis)))].tolist()
    return {
        "type": "spot",
        "to_world": mitsuba()
        .ScalarTransform4f()
        .look_at(list(light.origin), list(light.target), up),
        "intensity": rgb(light.intensity),
        "cutoff_angle": light.cutoff_angle,
        "beam_width": beam,
    }


@translate_light.register
def _(light: Directional, around: Surroundings) -> dict[str, Any]:
    return {
        "type": "directional",
        "direction": list(light.direction),
        "irradiance": rgb(light.irradiance),
    }


@translate_light.register
def _(light: Constant, around: Surroundings) -> dict[str, Any]:
    return {"type": "constant", "radiance": rgb(light.radiance)}


@translate_light.register
def _(light: EnvironmentMap, around: Surroundings) -> dict[str, Any]:
    """From our own radiance, the scale included."""
    table = light.tabulate(around.folder)
    to_world = np.eye(4)
    to_world[:3, :3] = table.to_map.reshape(3, 3).T
    return {
        "type": "envmap",
        "bitmap": mitsuba().Bitmap(np.ascontiguousarray(table.texels, dtype=np.float32)),
        "to_world": mitsuba().ScalarTransform4f(to_world),
    }


@translate_light.register
def _(light: Ambient, around: Surroundings) -> None:
    """A parameter of our Whitted plugin: nothing else sees it."""


def ambient_of(lights: tuple[Any, ...]) -> list[float]:
    """The radiance of all ambient lights together."""
    found = [light.radiance for light in lights if isinstance(light, Ambient)]
    return [float(x) for x in np.sum(found, axis=0)] if found else [0.0, 0.0, 0.0]
