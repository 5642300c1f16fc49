"""Lights that are not shapes -> Mitsuba."""

import math
from functools import singledispatch
from typing import Any

import numpy as np
from scipy.linalg import polar

from comparisons.geometry import affine
from comparisons.geometry.affine import is_similarity
from comparisons.geometry.flatten import Copy, Leaf, Member
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.second import described_image
from comparisons.mitsuba.translate.textures import (
    TranslationContext,
    UntranslatableError,
    projected,
    rgb,
)
from reference_rt.integrators import Direct
from reference_rt.lights import (
    Ambient,
    Constant,
    Directional,
    EnvironmentMap,
    Point,
    Projector,
    Spot,
)
from reference_rt.shapes import Box, Disk, Mesh, Rectangle, Sphere, Triangle
from reference_rt.shapes.shape import TabulationContext
from reference_rt.textures.image_file import read_image

SAMPLED = (Sphere, Rectangle, Disk, Box, Triangle, Mesh)
"""Emissive shapes of which `reference_rt` samples points, unless a map makes a sphere an ellipsoid.
Other emissive shapes, and parts of groups and of solids, shine where a ray of a BSDF's samples hits
them; Whitted's ray tracing has no such rays but mirrored ones, so that they light nothing."""


def never_samples(
    integrator: Any, copy: Copy, member: Member, leaf: Leaf, place: TabulationContext
) -> bool:
    """Whether a lamp lights nothing, because `reference_rt` samples lights alone and not this one.
    Mitsuba samples the mesh that stands in for it."""
    if not isinstance(integrator, Direct) or integrator.bsdf_samples > 0:
        return False
    shape = leaf.shape
    if copy.instance >= 0 or member.tree is not None or not isinstance(shape, SAMPLED):
        return True
    return isinstance(shape, Sphere) and not is_similarity(affine.map_in(shape, place)[:, :3])


@singledispatch
def translate_light(light: Any, context: TranslationContext) -> dict[str, Any] | None:
    """An emitter's dict; None for ambient light, see `ambient_of`.

    Raises UntranslatableError, ValueError for a file that cannot be used.
    """
    raise UntranslatableError(light, "light")


@translate_light.register
def _(light: Point, context: TranslationContext) -> dict[str, Any]:
    return {"type": "point", "position": list(light.position), "intensity": rgb(light.intensity)}


@translate_light.register
def _(light: Spot, context: TranslationContext) -> dict[str, Any]:
    beam = 0.75 * light.cutoff_angle if light.beam_width is None else light.beam_width
    texture: dict[str, Any] = {}
    if light.texture is None:
        # Any vector that is not parallel to the axis: the light is rotationally symmetric.
        up = np.eye(3)[int(np.argmin(np.abs(light.axis)))].tolist()
    else:
        # Mitsuba's images hang upside down: u to the left and v upwards, from the top row.
        up = [-x for x in light.up]
        texture = {"texture": projected(light.texture, context)}
    return {
        "type": "spot",
        "to_world": mitsuba()
        .ScalarTransform4f()
        .look_at(list(light.origin), list(light.target), up),
        "intensity": rgb(light.intensity),
        "cutoff_angle": light.cutoff_angle,
        "beam_width": beam,
        **texture,
    }


@translate_light.register
def _(light: Projector, context: TranslationContext) -> dict[str, Any]:
    """Mitsuba's irradiance is ours over pi, and the image's shape that of its pixels: what is left
    of ours stretches the light's own coordinates."""
    irradiance = projected(light.irradiance, context)
    pixels = irradiance["bitmap"].size() if "bitmap" in irradiance else (1, 1)
    stretch = float(pixels[0]) / float(pixels[1]) / light.aspect
    look = (
        mitsuba()
        .ScalarTransform4f()
        .look_at(list(light.origin), list(light.target), list(light.up))
    )
    return {
        "type": "projector",
        "to_world": look @ mitsuba().ScalarTransform4f().scale([1.0, stretch, 1.0]),
        "irradiance": irradiance,
        "scale": light.scale / math.pi,
        "fov": light.fov,
        "fov_axis": "x",
    }


@translate_light.register
def _(light: Directional, context: TranslationContext) -> dict[str, Any]:
    return {
        "type": "directional",
        "direction": list(light.direction),
        "irradiance": rgb(light.irradiance),
    }


@translate_light.register
def _(light: Constant, context: TranslationContext) -> dict[str, Any]:
    return {"type": "constant", "radiance": rgb(light.radiance)}


@translate_light.register
def _(light: EnvironmentMap, context: TranslationContext) -> dict[str, Any]:
    path = context.folder / light.file
    ours = read_image(path, light.encoding, light.scale, light.layer)
    texels = described_image(path, light.encoding, light.scale, light.layer, ours)
    # Written with seven digits, a rotation is not quite one.
    to_world = np.eye(4)
    to_world[:3, :3] = polar(affine.of_steps(light.transform)[:, :3])[0]
    return {
        "type": "envmap",
        "bitmap": mitsuba().Bitmap(np.ascontiguousarray(texels, dtype=np.float32)),
        "to_world": mitsuba().ScalarTransform4f(to_world),
    }


@translate_light.register
def _(light: Ambient, context: TranslationContext) -> None:
    """None: only our Whitted plugin has ambient light, as a parameter."""


def ambient_of(lights: tuple[Any, ...]) -> list[float]:
    """The summed radiance (R, G, B) of all ambient lights."""
    found = [light.radiance for light in lights if isinstance(light, Ambient)]
    return [float(x) for x in np.sum(found, axis=0)] if found else [0.0, 0.0, 0.0]
