"""Pictures of a scene and of the same scene transformed, and by how much they may differ."""

from collections.abc import Callable
from functools import lru_cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.relations import REACH, Motion, moved
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.in_mitsuba import rendered
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcome,
    Outcomes,
    of_pixels,
    unit_of,
)
from comparisons.experiments.stability.harness.scenes import SIZE
from comparisons.experiments.stability.harness.series import Draw
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.mitsuba.backend import scalar

STEPS = 4.0
"""Surfaces that a path meets: each adds an error of that size."""

SMOOTH = 512.0
"""Roundings of a radiance itself: some hundred operations at each of four surfaces."""


Renderer = Callable[[rt.Scene], FloatArray]
"""A scene's picture, (height, width, 3)."""


def colours(contestant: str, scene: rt.Scene) -> FloatArray:
    """By the scene's own integrator; Mitsuba's scalar variant, one seed.

    NaN where the scene is refused: areas and lengths that are no floats of the contestant's.
    """
    try:
        if contestant == OURS:
            return rt.render(scene).colour
        with scalar(), np.errstate(over="ignore"):  # what float32 cannot hold becomes infinite
            return rendered(scene, scene.resolved_sampler.spp, seed=1)
    except (rt.SceneError, RuntimeError):
        return np.full((scene.film.height, scene.film.width, 3), np.nan)


class Before(NamedTuple):
    """A picture of a scene before it is transformed, and by how much each channel of each pixel may
    change, both (height, width, 3)."""

    picture: FloatArray
    bound: FloatArray


def before(render: Renderer, scene: rt.Scene, shift: float, u: float) -> Before:
    """The bound is the picture's own condition: how it changes when the eye moves by `shift`, by
    which rounding may move a point of the transformed scene, or by half of it, in six directions.

    Where that meets an edge, a shadow's or a texture's, either side of it is right, and the bound
    says so; where it does not, the bound falls with u (offset + size) / size.  What depends on
    the scene as a whole, such as how often the sky is picked as a light, varies over its size: by
    shift / size of itself.  Of a pixel's channels the one that changes most counts: what moves may
    happen to keep another.
    """
    first = render(scene)
    others = [
        render(_moved_apart(scene, partial(_along, axis, part * shift)))
        for axis, part in product(range(3), (-1.0, -0.5, 0.5, 1.0))
    ]
    return Before(first, (SMOOTH * u + shift / SIZE) * np.abs(first) + _change(first, others))


@lru_cache(maxsize=4)
def remembered(contestant: str, scene: rt.Scene, shift: float) -> Before:
    """`before`, which is the same for all factors."""
    return before(partial(colours, contestant), scene, shift, unit_of(contestant))


@lru_cache(maxsize=4)
def moved_apart(contestant: str, scene: rt.Scene, shift: float) -> Before:
    """The same, with scenes in which everything is moved by itself besides."""
    base = remembered(contestant, scene, shift)
    move = partial(_anywhere, np.random.default_rng(0), shift)
    others = [colours(contestant, _moved_apart(scene, move)) for _ in range(AGAIN)]
    return Before(base.picture, base.bound + _change(base.picture, others))


def _change(first: FloatArray, others: list[FloatArray]) -> FloatArray:
    change = np.max([np.abs(other - first) for other in others], axis=0)
    return np.asarray(STEPS * change.max(axis=-1, keepdims=True))


def _along(axis: int, shift: float, part: object) -> FloatArray:
    """The camera's move; everything else stays."""
    return shift * np.eye(3)[axis] if isinstance(part, rt.Perspective) else np.zeros(3)


def _moved_apart(scene: rt.Scene, move: Callable[[object], FloatArray]) -> rt.Scene:
    """Camera, shapes and lights, each moved by itself."""

    def parts(whole: rt.Scene, part: object) -> rt.Scene:
        offset = move(part)
        return moved(whole, Motion(offset=tuple(offset.tolist()))) if offset.any() else whole

    camera = parts(rt.Scene(camera=scene.camera), scene.camera).camera
    shapes = tuple(parts(scene.changed(shapes=(s,)), s).shapes[0] for s in scene.shapes)
    lights = tuple(parts(rt.Scene(lights=(x,)), x).lights[0] for x in scene.lights)
    return scene.changed(camera=camera, shapes=shapes, lights=lights)


def wrong_pixels(found: FloatArray, base: Before) -> BoolArray:
    """(height, width)."""
    return np.asarray(~(np.abs(found - base.picture) <= base.bound).all(axis=-1))


FEW = 0.01
"""The part of a picture up to which wrong pixels are checked again.  A sample's path and
its shadow rays, some 12 segments of a length of about SIZE, pass edges, about as long as the scene
is large, within `shift` in less than 100 shift / SIZE of all cases: up to offsets of 1e10 sizes
that is 1 %.  Of more, none is checked again, and all have failed: this excuses nothing."""

AGAIN = 32
"""Scenes that these are compared with: everything in them is moved by itself, by `shift` in any
direction.  Along the normal of an edge each move is uniform in -shift..shift, and the difference of
two exceeds 1/2 shift in 28 % and shift in 1/8 of all scenes: that no scene of 32 crosses an edge as
far as rounding can has a chance of 3e-5 or 1.4 %.  A pixel that is wrong for another reason
does not change when things move by 1e-14, and has failed."""


def judged(contestant: str, scene: rt.Scene, motion: Motion, mirrored: bool = False) -> Outcome:
    """Each pixel is a case; the worst has the largest difference, as a share of the picture's mean.
    mirrored: the transformed picture is the other one's mirror image, left to right.

    What rounds separately at each surface no common move finds: where a few pixels are wrong, they
    are compared with scenes each part of which is moved by `shift` in a direction of its own.
    """
    render, u = partial(colours, contestant), unit_of(contestant)
    shift = REACH * u * (SIZE + max(map(abs, motion.offset)) / motion.factor)
    base = remembered(contestant, scene, shift)
    found = render(moved(scene, motion))
    if mirrored:
        found = found[:, ::-1]
    wrong = wrong_pixels(found, base)
    if 0 < wrong.sum() <= FEW * wrong.size:
        base = moved_apart(contestant, scene, shift)
        wrong = wrong_pixels(found, base)
    off = np.abs(found - base.picture).max(axis=-1)
    off = np.where(np.isfinite(off), off, np.inf)
    return of_pixels(
        wrong,
        {"before": base.picture, "after": found, "bound": base.bound},
        float(off.max() / base.picture.mean()),
    )


def _anywhere(rng: np.random.Generator, shift: float, part: object) -> FloatArray:
    v = rng.normal(size=3)
    return np.asarray(shift / np.linalg.norm(v) * v)


def under(motion: Callable[[float], Motion], draw: Draw, x: float) -> Outcomes:
    """Both lit scenes; Mitsuba renders the path-traced one alone."""
    path = scenes.path(draw.folder)
    found = {OURS: judged(OURS, path, motion(x))}
    found[OURS] += judged(OURS, scenes.whitted(draw.folder), motion(x))
    if draw.mitsuba:
        found[MITSUBA] = judged(MITSUBA, path, motion(x))
    return found
