"""Lights that project an image: Mitsuba's `projector`."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from comparisons.cameras.central import read_angle
from comparisons.cameras.film import Frame
from comparisons.lights.light import (
    TOLERANCE,
    Data,
    LightType,
    Motion,
    check_size,
    check_upright,
    look_of,
    similarity,
)
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading, triple
from comparisons.mitsuba.parse import LookAt, Step
from comparisons.textures.reading import projected as read_projected
from comparisons.textures.translate import projected
from reference_rt.core.image_files import open_image
from reference_rt.lights import Projector
from reference_rt.textures import Bitmap


def _to_mitsuba(light: Projector, context: TranslationContext) -> Data:
    """Mitsuba's irradiance is ours over pi, and the image's shape that of its pixels: what is left
    of ours stretches the light's own coordinates."""
    irradiance = projected(light.irradiance, context)
    width, height = 1, 1
    if "bitmap" in irradiance:
        width, height = irradiance["bitmap"].size()
    elif context.files is not None and isinstance(
        texture := context.textures.get(str(light.irradiance)), Bitmap
    ):
        width, height = _size(context.folder / texture.file)  # our own textures have one pixel
    shape = float(width) / float(height)
    stretch = _such_that(shape / light.aspect, lambda x: shape / x == light.aspect)
    steps = () if stretch == 1.0 else (Step("scale", (1.0, stretch, 1.0)),)
    return {
        "type": "projector",
        "to_world": context.to_world(*steps, LookAt(light.origin, light.target, light.up)),
        "irradiance": irradiance,
        "scale": _such_that(light.scale / math.pi, lambda x: math.pi * x == light.scale),
        "fov": float(light.fov),
        "fov_axis": "x",
    }


def _such_that(x: float, is_exact: Callable[[float], bool]) -> float:
    """x, or a number next to it that the reader turns into exactly what we have."""
    near = (x, math.nextafter(x, 0.0), math.nextafter(x, math.inf))
    return next((y for y in near if is_exact(y)), x)


def _from_mitsuba(reading: Reading, node: Node) -> Projector:
    m, (look, stretched) = node.transform(), look_of(node)
    check_size(node, m[:, 2])
    # What is taller than the image's pixels is a scale of y alone.
    tall = float(np.linalg.norm(m[:, 1]) / np.linalg.norm(m[:, 2]))
    if look is not None:
        tall = stretched
    elif abs(tall - 1.0) <= TOLERANCE:
        tall = 1.0
    rotation = similarity(node, m[:, :3] / np.array([1.0, tall, 1.0]))
    check_upright(node, rotation)
    origin, target, up = look or (
        triple(m[:, 3]),
        triple(m[:, 3] + rotation[:, 2]),
        triple(rotation[:, 1]),
    )
    irradiance = read_projected(reading, node, "irradiance", 1.0, "emission")
    width, height = 1, 1
    if isinstance(irradiance, str) and isinstance(reading.textures[irradiance], Bitmap):
        width, height = _size(reading.parsed.folder / reading.textures[irradiance].file)
    fov, wide = read_angle(node, Frame(width, height, 0, 0, width, height))
    # Mitsuba's intensity is pi times that of the irradiance at distance 1.
    return Projector(
        origin=origin,
        target=target,
        up=up,
        irradiance=irradiance,
        scale=math.pi * node.number("scale", 1.0),
        fov=fov["fov"] if fov["fov_axis"] == "x" else math.degrees(2.0 * math.atan(wide)),
        aspect=width / height / tall,
    )


def _size(file: Path) -> tuple[int, int]:
    """Of an image, in pixels."""
    image = open_image(file)
    return image.width, image.height


def _moved(light: Projector, motion: Motion) -> Projector | None:
    if motion.mirrors:
        return None
    there = {"origin": motion.point(light.origin), "target": motion.point(light.target)}
    return light.model_copy(update=there | {"scale": light.scale * motion.scale**2})


def _brightest(light: Projector) -> float:
    value = light.irradiance
    return light.scale * (1.0 if isinstance(value, str) else float(np.max(value)))


PROJECTOR = LightType(
    description=Projector,
    table=None,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"projector": _from_mitsuba},
    to_cycles=None,
    to_gltf=None,
    to_pbrt=None,
    to_povray=None,
    moved=_moved,
    at=lambda light: light.origin,
    along=None,
    surrounds=False,
    is_bounded=True,
    projects=lambda light: isinstance(light.irradiance, str),
    brightest=_brightest,
    float32=None,
)
