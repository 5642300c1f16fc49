"""Pictures of a scene and of the same scene transformed, and by how much they may differ."""

from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.float32 import UNIT_ROUNDOFF as U32
from comparisons.mitsuba_backend import scalar
from comparisons.mitsuba_scene import picture
from comparisons.stability.f09_rays import BoolArray
from comparisons.stability.f09_scenes import SIZE, Motion, moved
from comparisons.stability.family import EXAMPLES, MITSUBA, OURS, FloatArray, Outcome
from comparisons.translate import load
from reference_rt.ray import UNIT_ROUNDOFF

ROUNDOFF = {OURS: UNIT_ROUNDOFF, MITSUBA: U32}

REACH = 64.0
"""How far, in u times the largest coordinates, a point may be from where it should: a ray leaves a
surface by 16 sqrt(3) u (anchor + point + size) at most (`reference_rt.ray.surface_error`), 56 u of
the largest coordinate for what is small beside its distance; the eye, target and lights are rounded
by u each, the point that is shaded by two or three."""

STEPS = 4.0
"""Surfaces that a path meets: each adds an error of that size."""

SMOOTH = 512.0
"""Roundings of a radiance itself: some hundred operations at each of four surfaces."""


def colours(contestant: str, scene: rt.Scene) -> FloatArray:
    """(height, width, 3): the scene's own integrator; Mitsuba's scalar variant, one seed.

    NaN where the scene is refused: areas and lengths that are no floats of the contestant's.
    """
    try:
        if contestant == OURS:
            return rt.render(scene).colour
        with scalar():
            return picture(load(scene).mi_scene, scene.resolved_sampler.spp, seed=1)
    except (rt.SceneError, RuntimeError):
        return np.full((scene.film.height, scene.film.width, 3), np.nan)


class Before(NamedTuple):
    """A contestant's picture of a scene before it is transformed, and by how much each channel of
    each pixel may change, both (height, width, 3)."""

    picture: FloatArray
    bound: FloatArray


def before(contestant: str, scene: rt.Scene, motion: Motion) -> Before:
    """The bound is the picture's own condition: how it changes when the eye moves by as much as
    rounding may move a point of the transformed scene, or by half of it, in six directions.

    Where that meets an edge, a shadow's or a texture's, either side of it is right, and the bound
    says so; where it does not, the bound falls with u (offset + size) / size.  What depends on
    the scene as a whole, such as how often the sky is picked as a light, varies over its size: by
    shift / size of itself.
    """
    first = colours(contestant, scene)
    u = ROUNDOFF[contestant]
    extent = SIZE + max(map(abs, motion.offset)) / motion.factor
    shift = REACH * u * extent
    bound = (SMOOTH * u + shift / SIZE) * np.abs(first)
    change = np.zeros_like(first)
    for axis, part in product(range(3), (-1.0, -0.5, 0.5, 1.0)):
        other = colours(contestant, _seen_from(scene, axis, part * shift))
        change = np.maximum(change, np.abs(other - first))
    return Before(first, bound + STEPS * change)


def _seen_from(scene: rt.Scene, axis: int, shift: float) -> rt.Scene:
    camera = scene.camera
    places = {name: list(getattr(camera, name)) for name in ("eye", "target")}
    for place in places.values():
        place[axis] += shift
    update = {name: tuple(place) for name, place in places.items()}
    return scene.changed(camera=camera.model_copy(update=update))


def wrong_pixels(found: FloatArray, base: Before) -> BoolArray:
    """(height, width)."""
    return np.asarray(~(np.abs(found - base.picture) <= base.bound).all(axis=-1))


def judged(contestant: str, scene: rt.Scene, motion: Motion, mirrored: bool = False) -> Outcome:
    """Each pixel is a case.  worst: the largest difference, of the picture's mean.  mirrored: the
    transformed picture is the other one's mirror image, left to right."""
    base = before(contestant, scene, motion)
    found = colours(contestant, moved(scene, motion))
    if mirrored:
        found = found[:, ::-1]
    wrong = wrong_pixels(found, base)
    off = np.abs(found - base.picture).max(axis=-1)
    off = np.where(np.isfinite(off), off, np.inf)
    places = np.argwhere(wrong)[:EXAMPLES]
    told = partial(_hexadecimal, base, found)
    return Outcome(
        wrong.size,
        int(np.count_nonzero(wrong)),
        float(off.max() / base.picture.mean()),
        0,
        tuple(told(int(y), int(x)) for y, x in places),
    )


def _hexadecimal(base: Before, found: FloatArray, y: int, x: int) -> dict[str, object]:
    def told(values: FloatArray) -> list[str]:
        return [value.hex() for value in values[y, x].tolist()]

    return {
        "pixel": [x, y],
        "before": told(base.picture),
        "after": told(found),
        "bound": told(base.bound),
    }
