"""The error bound of f cos L of one light, for the rung of direct light."""

from collections.abc import Callable
from functools import partial

import numpy as np

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.lights import type_of
from comparisons.materials.coat import PASSED
from comparisons.rungs.rays.light_context import (
    DISTANT,
    POINT_LIKE,
    LightContext,
    described,
    kind_of,
)
from comparisons.rungs.rays.mitsuba_light import lamp_at
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.slide import slide
from comparisons.rungs.rays.slopes import is_steep, moved, slopes, turned
from comparisons.translator.accuracy import accuracy, coat_error, is_tilted
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import AREA, ENVIRONMENT
from reference_rt.materials import Emissive
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene

FAINTEST = 1e-12
"""Absolute error, as a fraction of the brightest hit of any light: far above where float32
underflows, and where Mitsuba cuts off microfacet densities (1e-20)."""

ROUNDED = 8.0 * UNIT_ROUNDOFF
"""Absolute error of the squared sine at a microfacet: its normal, the product with a direction, and
the square are rounded some eight times."""

MIDDLE = (0.5, 0.5)
"""The point of a light that represents it in Whitted's ray tracing."""

TURNS = 4.0
"""A ray that is turned by an angle turns the half vector of a highlight by half of it, and that of
refracted light by 1 / (1 + eta) of it or more: a quarter, for indices up to 3."""


def bounds(
    context: LightContext,
    light: int,
    target: FloatArray,
    values: tuple[FloatArray, FloatArray, FloatArray],
    brightest: float,
) -> FloatArray:
    """(n,): how far float32 may move f cos L.

    Relative to f L, with e the slide of the shaded point and r the light's distance: the normal
    turns by 2 e over the shape's feature size, the direction by e / r; the inverse square changes
    by 2 e / r; and the products round some 16 times.  Along a mesh that stands in for a shape the
    point slides further, but the normal turns no more.
    """
    value, theirs, their_cosine = values
    rays, hits = context.rays, context.hits
    e = slide(context.sizes, rays.o, rays.d, hits, context.off_by("sag"))
    kind = kind_of(context, light)
    if kind in DISTANT:
        w, distance = target, np.full(len(target), np.inf)
    else:
        w = target - hits.p
        distance = np.linalg.norm(w, axis=1)
    cosine = np.sum(w * hits.ns, axis=1) / np.linalg.norm(w, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        # The cosine may be negative: refracted light arrives from behind.
        ours_full = np.nan_to_num(value.max(axis=1) / np.abs(cosine))
        theirs_full = np.nan_to_num(theirs.max(axis=1) / np.abs(their_cosine))
    turn = 2.0 * e / _feature(context) + context.off_by("turn")
    relative = turn + 4.0 * (e + along_mesh(context)) / distance + 16.0 * UNIT_ROUNDOFF
    relative += _of_leaves(context, accuracy)
    full = np.maximum(ours_full, theirs_full)
    # The cosine to a mapped normal is not that to the shading normal, and may be near 0.
    tilted = _of_leaves(context, is_tilted) > 0.0
    full = np.where(tilted, np.maximum(full, brightest), full)
    bound = full * relative + FAINTEST * brightest + cut_off(context.scene)
    through = cosine * np.sum(rays.d * hits.ns, axis=1) > 0.0
    coat = _of_leaves(context, coat_error)
    for passing, share in ((through, PASSED), (coat > 0.0, coat)):
        bound += np.where(passing, share * value[passing].max(initial=0.0), 0.0)
    bound += np.where(through, np.maximum(value, theirs).max(axis=1), 0.0) * _of_critical(
        context, rays.d, w, hits.ns
    )
    float32 = POINT_LIKE[kind].float32 if kind in POINT_LIKE else None
    if float32 is not None:
        bound += np.maximum(value, theirs).max(axis=1) * float32(described(context, light), hits.p)
    return np.asarray(bound)


def of_direct_light(context: LightContext) -> FloatArray:
    """(n,): how far float32 may move the light that Whitted's ray tracing takes from the middles of
    all lights, at the first hits."""
    total = np.zeros(len(context.hits.t))
    choice = context.tables.lights.choice
    if choice is None:
        return total
    rays, hits = context.rays, context.hits
    for light in np.flatnonzero((choice.kind != ENVIRONMENT) & (choice.probability > 0.0)).tolist():
        ours = query.direct_light(context.tables, rays.o, rays.d, light, MIDDLE)
        lit = np.flatnonzero(ours.pdf > 0.0)
        if len(lit) == 0:
            continue
        value, target = ours.contribution[lit] / ours.pdf[lit, None], ours.target[lit]
        distant = kind_of(context, light) in DISTANT
        w = target if distant else target - hits.p[lit]
        cosine = np.sum(w * hits.ns[lit], axis=1) / np.linalg.norm(w, axis=1)
        some = context.of(lit)
        total[lit] += bounds(some, light, target, (value, value, cosine), 0.0)
        if kind_of(context, light) == AREA:
            total[lit] += value.max(axis=1) * of_area(some, target)
    return total


def of_area(context: LightContext, target: FloatArray) -> FloatArray:
    """(n,): the relative error of the area of the lamps that points (n, 3) lie on.

    float32 rounds each corner by u of its largest coordinate, so that a length between two corners
    is off by 2 u of it, and an area, of two lengths, by 4 u over the smaller one."""
    lamp, sizes = lamp_at(context, target), context.sizes
    largest = np.maximum(sizes.frame.largest(target), sizes.reach_of(lamp.shape))
    return np.asarray(4.0 * UNIT_ROUNDOFF * largest / sizes.feature_of(lamp))


def _feature(context: LightContext) -> FloatArray:
    """(n,): the smallest length on which the normals of the hit shapes change, in either renderer,
    or, where the scene has textures, their uv."""
    sizes, hits = context.sizes, context.hits
    length = sizes.feature_of(hits) if context.scene.textures else sizes.bend_of(hits)
    return np.minimum(length, context.theirs.height)


def cut_off(scene: Scene) -> float:
    """The absolute error of light: Mitsuba cuts off microfacet densities below 1e-20, which matters
    where rays meet nothing brighter.

    A hundred times 1e-20 of the largest radiance, irradiance or intensity of any light, which is 1
    for images.
    """
    lamps = [m for m in scene.materials.values() if isinstance(m, Emissive)]
    sizes = [0.0, *(type_of(light).brightest(light) for light in scene.lights)]
    sizes += [1.0 if isinstance(m.radiance, str) else float(np.max(m.radiance)) for m in lamps]
    return 1e-18 * max(sizes)


def _of_leaves(context: LightContext, error: Callable[[Scene, str], float]) -> FloatArray:
    """(n,): an error of the hit materials, see `comparisons.translator.accuracy`."""
    scene, names = context.scene, [of.material for of in context.sizes.leaves]
    by_leaf = np.array([error(scene, name) if name else 0.0 for name in names] + [0.0])
    return np.asarray(by_leaf[context.sizes.leaf_of(context.hits)])


def _of_critical(context: LightContext, d: FloatArray, w: FloatArray, n: FloatArray) -> FloatArray:
    """(n,): the relative error, at most 1, of light from w that rough glass refracts into -d.

    Next to the critical angle Mitsuba loses digits: it computes the cosine c behind the microfacet
    as a root of 1 - (eta sin)², of which a share of c² / eta² is left.  And where the index is
    nearly 1, the half vector -d + eta w nearly vanishes, and with it the sum of cosines that it
    divides by, squared.  Where the scene has several glasses, the largest error of any counts.
    """
    leaves = context.tables.materials.leaves
    tables = [table for table in (leaves.rough_dielectrics, leaves.principleds) if table]
    largest = np.zeros(len(d))
    wo, wi = (v / np.linalg.norm(v, axis=1)[:, None] for v in (-d, w))
    for index in np.unique([eta for table in tables for eta in table.eta]):
        eta = np.where(np.sum(wo * n, axis=1) > 0.0, index, 1.0 / index)[:, None]
        half = wo + eta * wi
        length = np.linalg.norm(half, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            cosines = [np.abs(np.sum(v * half, axis=1)) / length for v in (wo, wi)]
            ratio = max(index, 1.0 / index)
            error = ROUNDED * ((ratio / np.minimum(*cosines)) ** 2 + 2.0 * ratio / length)
        largest = np.maximum(largest, np.nan_to_num(error, nan=1.0))
    return np.minimum(largest, 1.0)


def slopes_of(
    context: LightContext,
    light: int,
    u: tuple[float, float],
    value: FloatArray,
) -> FloatArray:
    """(n,): how much f cos L changes within float32's bound because of highlights and textures:
    measured with our tracer along moved rays.

    A mesh that stands in for a shape has other normals, and other tangents, on which some materials
    depend: as much changes along a ray that is turned by TURNS times the angle about the point.
    """

    def value_of(other: Rays) -> FloatArray:
        return query.direct_light(context.tables, other.o, other.d, light, u).contribution

    others: list[Callable[[], FloatArray]] = []
    rays, hits = context.rays, context.hits
    bent = np.zeros(len(value))
    if is_steep(context.scene):
        angle = context.off_by("turn")
        if context.tables.materials.oriented is not None:
            angle += context.off_by("twist")
        radius = context.sizes.frame.delta(rays.o, hits.p, context.sizes.reach_of(hits.shape))
        angle += np.where(np.isfinite(context.theirs.height), radius / _feature(context), 0.0)
        apart = context.off_by("sag") + context.off_by("shift") + along_mesh(context)
        others = [partial(value_of, other) for other in moved(rays, radius + apart)]
        if angle.any():
            for other in turned(rays, hits.p, TURNS * angle):
                there = query.intersect(context.tables, other.o, other.d)
                same = np.linalg.norm(there.p - hits.p, axis=1) <= radius
                change = np.abs(value_of(other) - value).max(axis=1)
                bent = np.maximum(bent, np.where(same, 2.0 * change, 0.0))
    return bent + slopes(value, others, float(value.max(initial=0.0)))


def along_mesh(context: LightContext) -> FloatArray:
    """(n,): how far float32 moves a point along a mesh that stands in for a shape; 0 on other
    shapes, whose slivers `ShapeSizes` knows."""
    rays, hits, sizes = context.rays, context.hits, context.sizes
    radius = sizes.frame.delta(rays.o, hits.p, sizes.reach_of(hits.shape))
    return radius * context.theirs.aspect
