"""Integrators -> Mitsuba."""

from functools import singledispatch
from typing import Any

from comparisons.mitsuba.translate.textures import UntranslatableError
from reference_rt.integrators import Direct, Path, RayCast, Whitted
from reference_rt.lights import Constant, Directional, EnvironmentMap, Point, Projector, Spot
from reference_rt.materials import Emissive, Mask, ThinDielectric
from reference_rt.scene.model import SceneModel


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
