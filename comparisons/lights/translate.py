"""Lights that are not shapes -> Mitsuba."""

import math
from functools import singledispatch
from typing import Any

import numpy as np
from scipy.linalg import polar

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext, UntranslatableError, rgb
from comparisons.mitsuba.second import described_image
from comparisons.textures.translate import projected
from reference_rt.integrators import Direct, Path, RayCast, Whitted
from reference_rt.lights import (
    Ambient,
    Constant,
    Directional,
    EnvironmentMap,
    Point,
    Projector,
    Spot,
)
from reference_rt.materials import Emissive, Mask, ThinDielectric
from reference_rt.scene.model import SceneModel
from reference_rt.textures.image_file import read_image


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


@singledispatch
def translate_integrator(integrator: Any) -> dict[str, Any] | None:
    """An integrator's dict; None if there is no picture to compare.

    Raises UntranslatableError.
    """
    raise UntranslatableError(integrator, "integrator")


@translate_integrator.register
def _(integrator: Path) -> dict[str, Any]:
    """The sampling strategy of ours does not change the mean."""
    depth = -1 if integrator.max_depth is None else integrator.max_depth
    found = {"type": "path", "max_depth": depth, "rr_depth": integrator.rr_depth}
    return found | _hiding(integrator)


@translate_integrator.register
def _(integrator: Direct) -> dict[str, Any]:
    if not integrator.shadows:
        raise UntranslatableError("direct without shadows", "integrator")
    lights, bsdfs = integrator.light_samples, integrator.bsdf_samples
    found = {"type": "direct", "emitter_samples": lights, "bsdf_samples": bsdfs}
    return found | _hiding(integrator)


def _hiding(integrator: Path | Direct) -> dict[str, Any]:
    return {"hide_emitters": True} if integrator.hide_emitters else {}


def misplaces(scene: SceneModel) -> bool:
    """Whether Mitsuba's integrators would be wrong for a scene: what they see behind a hidden lamp
    is placed by the new ray's distance from the old ray's origin, unless it is a mesh (Mitsuba
    3.9.1, `SamplingIntegrator::skip_area_emitters`)."""
    return isinstance(scene.integrator, Path | Direct) and scene.integrator.hide_emitters


def in_place_of(scene: SceneModel, has_solids: bool = False) -> dict[str, Any] | None:
    """Our integrator, which runs in Mitsuba, for a scene for which Mitsuba's own is wrong, or that
    has solids; None for all others."""
    integrator = scene.integrator
    if not isinstance(integrator, Path | Direct):
        return None
    wrong = squares_opacity(scene) or misplaces(scene)
    return of_solids(integrator) if has_solids or wrong else None


def counts_lights_often(scene: SceneModel) -> bool:
    """Whether Mitsuba's integrator `direct` would be wrong for a scene: it adds up its samples of
    lights without extent, which it should average (src/integrators/direct.cpp: their weight is 1
    whatever `emitter_samples` is), so that they are as many times too bright.  The mean does not
    depend on the number, and the counterpart has one."""
    integrator = scene.integrator
    points = any(
        isinstance(light, Point | Spot | Projector | Directional) for light in scene.lights
    )
    return points and isinstance(integrator, Direct) and integrator.light_samples > 1


def squares_opacity(scene: SceneModel) -> bool:
    """Whether Mitsuba's integrator `path` would be wrong for a scene: on masks that are neither
    opaque nor absent it multiplies samples of lights by the opacity twice.  A diffuse plane under a
    point light then has a quarter of its light at an opacity of a half, where Mitsuba's BSDF and
    its integrator `direct` give half of it (Mitsuba 3.9.1)."""
    masks = [m for m in scene.materials.values() if isinstance(m, Mask)]
    return isinstance(scene.integrator, Path) and any(m.opacity not in (0.0, 1.0) for m in masks)


BLACK: dict[str, Any] = {
    "type": "constant",
    "radiance": {"type": "rgb", "value": [0.0, 0.0, 0.0]},
    "sampling_weight": 0.0,
}
"""An environment without light, which is never sampled."""


def drops_light(scene: SceneModel) -> bool:
    """Whether Mitsuba's integrator `path` would be wrong for a scene: where there is no environment
    it returns black for a path that only passes straight through surfaces, and so drops the
    emission of a lamp that lets light pass so.  A thin pane that shines shows 8 % of its radiance,
    with BLACK all of it, as with `volpath` (Mitsuba 3.9.1)."""
    environments = any(isinstance(x, Constant | EnvironmentMap) for x in scene.lights)
    kinds = {type(material) for material in scene.materials.values()}
    passing = not kinds.isdisjoint((ThinDielectric, Mask))
    return isinstance(scene.integrator, Path) and not environments and passing and Emissive in kinds


def of_solids(integrator: Path | Direct) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.path_of_solids` in place of Mitsuba's integrator, for
    scenes with solids, with masks, and with hidden lamps."""
    if isinstance(integrator, Path):
        return {**(translate_integrator(integrator) or {}), "type": "path_of_solids"}
    translate_integrator(integrator)  # refuses what has no counterpart
    return {
        "type": "path_of_solids",
        "max_depth": 2,
        "samples_lights": integrator.light_samples > 0,
        "samples_bsdfs": integrator.bsdf_samples > 0,
        **_hiding(integrator),
    }


@translate_integrator.register
def _(integrator: Whitted) -> dict[str, Any]:
    """Our plugin `comparisons.mitsuba.plugins.whitted`; the rung adds the parameters of lights."""
    return {
        "type": "whitted",
        "max_depth": integrator.max_depth,
        "min_contribution": integrator.min_contribution,
    }


@translate_integrator.register
def _(integrator: RayCast) -> None:
    """None: the rung of geometry compares ray casting ray by ray."""
