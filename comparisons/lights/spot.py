"""Spot lights: Mitsuba's `spot`, also with an image."""

from typing import Any

import numpy as np

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.lights.light import (
    Data,
    LightType,
    Motion,
    Punctual,
    across,
    brighter,
    brightest_of,
    check_upright,
    look_of,
    plain,
    similarity,
)
from comparisons.mitsuba.context import TranslationContext, rgb
from comparisons.mitsuba.files import UnwritableError
from comparisons.mitsuba.node import Node, Reading, Triple, triple
from comparisons.mitsuba.parse import LookAt
from comparisons.renderers.vocabulary import GltfWriter, Params, PbrtWriter
from comparisons.textures.reading import projected as read_projected
from comparisons.textures.translate import projected
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import Spot


def beam_of(light: Spot) -> float:
    """Its beam width, or the default of both renderers."""
    return 0.75 * light.cutoff_angle if light.beam_width is None else light.beam_width


def _opposite(up: Triple) -> Triple:
    """Mitsuba's images hang upside down: u to the left and v upwards, from the top row."""
    x, y, z = up
    return -x, -y, -z


def _to_mitsuba(light: Spot, context: TranslationContext) -> Data:
    found: Data = {}
    # Without an image it is rotationally symmetric.
    up = triple(across(light.axis))
    if light.texture is not None:
        up = _opposite(light.up)
        found["texture"] = projected(light.texture, context)
    return {
        "type": "spot",
        "to_world": context.to_world(LookAt(light.origin, light.target, up)),
        "intensity": rgb(light.intensity),
        "cutoff_angle": float(light.cutoff_angle),
        "beam_width": float(beam_of(light)),
        **found,
    }


def _from_mitsuba(reading: Reading, node: Node) -> Spot:
    m = node.transform()
    rotation = similarity(node, m[:, :3])
    axis = m[:, 2] / np.linalg.norm(m[:, 2])
    cutoff = node.number("cutoff_angle", 20.0)
    image: dict[str, Any] = {}
    if node.has("texture"):
        texture = read_projected(reading, node, "texture", 1.0)
        if not isinstance(texture, str):
            raise node.error("'texture' is a colour, which Mitsuba refuses, too; expected an image")
        check_upright(node, rotation)
        image = {"texture": texture, "up": triple(-rotation[:, 1])}
    look, _ = look_of(node)
    if look is not None and image:
        image["up"] = _opposite(look.up)
    return Spot(
        **image,
        origin=triple(m[:, 3]) if look is None else look.origin,
        target=triple(m[:, 3] + axis) if look is None else look.target,
        intensity=plain(node, "intensity"),
        cutoff_angle=cutoff,
        beam_width=node.number("beam_width", 0.75 * cutoff),
    )


def _to_gltf(light: Spot, name: str, writing: GltfWriter) -> Punctual:
    if light.texture is not None or light.cutoff_angle > 90.0:
        raise UnwritableError("a spot with a texture, or wider than a half-space")
    writing.note("renderers choose how spots fall off towards their rims")
    outer = float(np.radians(light.cutoff_angle))
    inner = min(float(np.radians(beam_of(light))), outer * (1.0 - 1e-6))
    cone = {"spot": {"innerConeAngle": inner, "outerConeAngle": outer}}
    return Punctual(light.intensity, light.origin, light.axis, cone)


def _to_pbrt(light: Spot, writing: PbrtWriter) -> tuple[str, Params]:
    if light.texture is not None or light.beam_width != light.cutoff_angle:
        raise UnwritableError(
            "a spot with a texture, or with a beam_width below its cutoff_angle: its falloff "
            "between them is linear in the angle"
        )
    place = {"point3 from": light.origin, "point3 to": light.target}
    cone = {"float coneangle": light.cutoff_angle, "float conedeltaangle": 0.0}
    return "spot", {"rgb I": light.intensity, **place, **cone}


def _moved(light: Spot, motion: Motion) -> Spot | None:
    if motion.mirrors and light.texture is not None:
        return None
    there = {"origin": motion.point(light.origin), "target": motion.point(light.target)}
    return light.model_copy(update=there | {"intensity": brighter(light.intensity, motion)})


def _float32(light: Spot, p: FloatArray) -> FloatArray:
    """Of the falloff: Mitsuba computes the angle from the cosine, whose rounding turns the angle by
    4 u over its sine, and divides by the width of the rim; the falloff itself goes to 0 at the
    outer edge, beyond which no light is excused."""
    beam = beam_of(light)
    width, sine = np.radians(light.cutoff_angle - beam), np.sin(np.radians(max(beam, 1.0)))
    if not (width > 0.0 and sine > 0.0):
        return np.zeros(len(p))
    axis, out = np.subtract(light.target, light.origin), p - light.origin
    off_axis = np.linalg.norm(np.cross(axis, out), axis=1)
    angle = np.arctan2(off_axis, np.sum(axis * out, axis=1))
    falloff = (np.radians(light.cutoff_angle) - angle) / width
    error = 4.0 * UNIT_ROUNDOFF / (sine * width)
    return np.where(falloff < -error, 0.0, error / np.clip(falloff, error, 1.0))


SPOT = LightType(
    description=Spot,
    table=None,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"spot": _from_mitsuba},
    to_cycles=None,
    to_gltf=_to_gltf,
    to_pbrt=_to_pbrt,
    to_povray=None,
    moved=_moved,
    at=lambda light: light.origin,
    along=None,
    surrounds=False,
    is_bounded=True,
    projects=lambda light: light.texture is not None,
    brightest=brightest_of("intensity"),
    float32=_float32,
)
