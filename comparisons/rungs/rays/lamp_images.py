"""How much light changes within float32's error of the point on a lamp that has a texture."""

import dataclasses
from functools import partial

import numpy as np

from comparisons.rungs.rays.arbiter import BoolArray
from comparisons.rungs.rays.light_context import LightContext, kind_of
from comparisons.rungs.rays.light_error import MIDDLE
from comparisons.rungs.rays.slopes import NEAR, slopes
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import WhittedSetup
from reference_rt.lights import AREA, ENVIRONMENT, EnvironmentMap
from reference_rt.materials import Emissive
from reference_rt.rendering import query

U_STEP = 2.0**-20
"""Step in (u, v) for the slope of textured lights: float32's error for a light TIMES as far away as
it is large."""

TIMES = 10.0


def magnified(context: LightContext, light: int, target: FloatArray, pdf: FloatArray) -> FloatArray:
    """(n,): float32's error of (u, v) on a textured light, in units of U_STEP, at least 1; 0 where
    its radiance does not vary.

    It is the error of a point across the ray, over the light's size and its cosine:
    1 / pdf = area cosine / distance² is the solid angle;  target, pdf: see `query.DirectLight`.
    """
    if not _has_image(context, light):
        return np.zeros(len(pdf))
    if kind_of(context, light) != AREA:
        return np.ones(len(pdf))
    w = target - context.hits.p
    there = query.intersect(context.tables, target - NEAR * w, w)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.abs(np.sum(there.n * w, axis=1)) / np.linalg.norm(w, axis=1)
        size = np.nan_to_num(np.sqrt(pdf / cosine) / TIMES, posinf=1.0)
    return np.asarray(np.maximum(size, 1.0))


def slopes_of_image(
    context: LightContext,
    light: int,
    u: tuple[float, float],
    value: FloatArray,
    scale: FloatArray,
) -> FloatArray:
    """(n,): how much `value` changes within the errors `scale` (n,) of (u, v): see `magnified`."""
    if not scale.any():
        return np.zeros(len(value))
    others = [partial(_value_at, context, light, at) for at in _beside(u, 1.0)]
    return scale * slopes(value, others, float(value.max(initial=0.0)))


def is_beside(
    context: LightContext,
    light: int,
    u: tuple[float, float],
    wanted: FloatArray,
    allowed: FloatArray,
    scale: FloatArray,
) -> BoolArray:
    """(n,): whether the light has Mitsuba's value, `wanted` (n, 3), next to u, up to `allowed`
    (n,): at the edge of a texel."""
    beside = np.zeros(len(wanted), bool)
    if not scale.any():
        return beside
    for at in _beside(u, float(scale.max())):
        error = np.abs(_value_at(context, light, at) - wanted).max(axis=1)
        beside |= (error <= allowed) & (scale > 0.0)
    return beside


def changes_of_lamps(context: LightContext, setup: WhittedSetup) -> tuple[FloatArray, FloatArray]:
    """The least and the greatest change, (n, 3) each, of the light that Whitted's ray tracing takes
    from the middles of textured lamps, directly and in mirrors, within float32's error of (u, v).

    Each lamp is moved alone, with all others off, so that the changes of several add up.
    """
    low, high = np.zeros((2, len(context.hits.t), 3))
    tables, rays = context.tables, context.rays
    choice = tables.lights.choice
    if choice is None or len(rays.o) == 0:
        return low, high
    for light in np.flatnonzero((choice.kind == AREA) & (choice.probability > 0.0)).tolist():
        ours = query.direct_light(tables, rays.o, rays.d, light, MIDDLE)
        scale = magnified(context, light, ours.target, ours.pdf)
        if not scale.any():
            break  # no lamp has a texture
        alone = np.where(np.arange(len(choice.kind)) == light, choice.probability, 0.0)
        lights = tables.lights._replace(choice=choice._replace(probability=alone))
        lit = dataclasses.replace(tables, lights=lights)
        around = [
            query.radiance_without_noise(lit, setup._replace(u0=u0, u1=u1), rays.o, rays.d)
            for u0, u1 in [MIDDLE, *_beside(MIDDLE, float(scale.max()), AROUND)]
        ]
        changes = np.stack(around[1:]) - around[0]
        low += np.minimum(changes.min(axis=0), 0.0)
        high += np.maximum(changes.max(axis=0), 0.0)
    return low, high


AROUND = 128
"""Points around MIDDLE: the texture of a disk goes round its middle, with all its rows."""


def _beside(u: tuple[float, float], scale: float, count: int = 4) -> list[tuple[float, float]]:
    """The (u, v) that are `scale` U_STEP away, in `count` directions."""
    step, turns = scale * U_STEP, 2.0 * np.pi * np.arange(count) / count
    return [(u[0] + step * np.cos(a), u[1] + step * np.sin(a)) for a in turns]


def _value_at(context: LightContext, light: int, u: tuple[float, float]) -> FloatArray:
    rays = context.rays
    light_there = query.direct_light(context.tables, rays.o, rays.d, light, u)
    return np.asarray(light_there.contribution)


def _has_image(context: LightContext, light: int) -> bool:
    """Whether a texture makes the radiance of a light vary over it, or with the direction."""
    kind, scene = kind_of(context, light), context.scene
    if kind == ENVIRONMENT:
        return any(isinstance(described, EnvironmentMap) for described in scene.lights)
    emissive = (m for m in scene.materials.values() if isinstance(m, Emissive))
    return kind == AREA and any(isinstance(m.radiance, str) for m in emissive)
