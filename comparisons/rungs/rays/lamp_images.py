"""How much light changes within float32's error of the point on a lamp that has a texture."""

import dataclasses
from collections.abc import Iterator
from functools import partial

import numpy as np

from comparisons.rungs.rays.arbiter import BoolArray
from comparisons.rungs.rays.light_context import LightContext, kind_of
from comparisons.rungs.rays.light_error import MIDDLE, of_area
from comparisons.rungs.rays.mitsuba_light import lamp_at, leads_past
from comparisons.rungs.rays.slopes import NEAR, slopes
from comparisons.rungs.rays.tree_error import Nodes
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import WhittedSetup
from reference_rt.lights import AREA, ENVIRONMENT, EnvironmentMap
from reference_rt.materials import Emissive
from reference_rt.rendering import query

U_STEP = 2.0**-20
"""Step in (u, v) for the slope of textured lights, and the least error of (u, v): their own
rounding, from the corners of a triangle or from a direction."""


def magnified(context: LightContext, light: int, target: FloatArray, pdf: FloatArray) -> FloatArray:
    """(n,): float32's error of (u, v) on a textured light, in units of U_STEP, at least 1; 0 where
    its radiance does not vary.

    It is the error of a point across the ray from the surface, `Frame.delta`, over the light's
    cosine and the side of a square of its area, which follows from the solid angle
    1 / pdf = area cosine / distance²;  target, pdf: see `query.DirectLight`.
    """
    if not _has_image(context, light):
        return np.zeros(len(pdf))
    if kind_of(context, light) != AREA:
        return np.ones(len(pdf))
    p, sizes = context.hits.p, context.sizes
    w = target - p
    distance = np.linalg.norm(w, axis=1)
    there = query.intersect(context.tables, target - NEAR * w, w)
    across = sizes.frame.delta(p, target, sizes.reach_of(there.shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.abs(np.sum(there.n * w, axis=1)) / distance
        side = distance / np.sqrt(pdf * cosine)
        error = np.nan_to_num(across / (cosine * side), posinf=1.0)
    return np.asarray(np.maximum(error / U_STEP, 1.0))


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
    for radius, rows in _circles(scale):
        some = context.of(rows)
        for at in _beside(u, radius):
            error = np.abs(_value_at(some, light, at) - wanted[rows]).max(axis=1)
            beside[rows] |= error <= allowed[rows]
    return beside


def changes_of_lamps(
    context: LightContext, nodes: Nodes, n: int, setup: WhittedSetup
) -> tuple[FloatArray, FloatArray]:
    """The least and the greatest change, (n, 3) each, of the light that Whitted's ray tracing takes
    from the middles of lamps, within float32's error of the point at each node of the trees of n
    rays: a texture may have another colour there, and rays pass a lamp that is narrower than that
    error.  A mirror may show a surface from which a lamp is far, or seen edge-on.

    Each lamp is moved alone, with all others off, so that the changes of several add up.
    context: of the nodes' rays.
    """
    low, high = np.zeros((2, n, 3))
    tables, rays = context.tables, context.rays
    choice, setup = tables.lights.choice, setup._replace(max_depth=0)
    if choice is None or len(rays.o) == 0:
        return low, high
    for light in np.flatnonzero((choice.kind == AREA) & (choice.probability > 0.0)).tolist():
        ours = query.direct_light(tables, rays.o, rays.d, light, MIDDLE)
        for total, change in zip((low, high), _of_narrow(context, ours), strict=True):
            np.add.at(total, nodes.row, nodes.weight * change)
        scale = magnified(context, light, ours.target, ours.pdf)
        if not scale.any():
            continue  # it has no texture
        alone = np.where(np.arange(len(choice.kind)) == light, choice.probability, 0.0)
        lights = tables.lights._replace(choice=choice._replace(probability=alone))
        lit = dataclasses.replace(tables, lights=lights)
        least, most = np.zeros((2, *rays.o.shape))
        for radius, some in _circles(np.where(ours.pdf > 0.0, scale, 0.0)):
            around = [
                query.radiance_without_noise(
                    lit, setup._replace(u0=u0, u1=u1), rays.o[some], rays.d[some]
                )
                for u0, u1 in [MIDDLE, *_beside(MIDDLE, radius, AROUND)]
            ]
            changes = np.stack(around[1:]) - around[0]
            least[some] = np.minimum(least[some], changes.min(axis=0))
            most[some] = np.maximum(most[some], changes.max(axis=0))
        for total, change in ((low, least), (high, most)):
            np.add.at(total, nodes.row, nodes.weight * change)
    return low, high


def _of_narrow(context: LightContext, ours: query.DirectLight) -> tuple[FloatArray, FloatArray]:
    """(n, 3) each: the least and the greatest change of the light of a lamp, of which float32 moves
    the corners: all its light is lost where that is more than its width."""
    low, high = np.zeros((2, *ours.contribution.shape))
    lit = np.flatnonzero(ours.contribution.any(axis=1) & (ours.pdf > 0.0))
    if len(lit) == 0:
        return low, high
    some, target = context.of(lit), ours.target[lit]
    p, sizes = some.hits.p, context.sizes
    lamp = lamp_at(some, target).shape.astype(np.int64)
    radius = sizes.frame.delta(p, target, sizes.reach_of(lamp))
    value, relative = ours.contribution[lit] / ours.pdf[lit, None], of_area(some, target)
    missed = leads_past(some, target, lamp, radius)
    low[lit] = -value * np.where(missed, 1.0, np.minimum(relative, 1.0))[:, None]
    high[lit] = value * relative[:, None]
    return low, high


AROUND = 128
"""Points around MIDDLE: the texture of a disk goes round its middle, with all its rows."""

MOST_DOUBLINGS = 18
"""Of U_STEP: the circle is half of the lamp wide.  Where the error is larger, nothing of the lamp
is resolved."""


def _circles(scale: FloatArray) -> Iterator[tuple[float, IntArray]]:
    """The radii, in units of U_STEP, of circles that are each twice as large, and the rows of
    `scale` (n,) whose error is more than half of them: between a large circle and its middle lie
    texels that it does not meet."""
    with np.errstate(divide="ignore"):
        doublings = np.minimum(np.ceil(np.log2(scale)), MOST_DOUBLINGS)
    for k in range(int(doublings.max(initial=-1.0)) + 1):
        yield 2.0**k, np.flatnonzero(doublings >= k)


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
