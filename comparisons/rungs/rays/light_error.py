"""The error bound of f cos L of one light, for the rung of direct light."""

from collections.abc import Callable

import numpy as np

from comparisons.geometry.float32 import UNIT_ROUNDOFF
from comparisons.mitsuba.accuracy import accuracy
from comparisons.rungs.rays.bounds import slide
from comparisons.rungs.rays.light_context import LightContext, described, kind_of
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.slopes import is_steep, moved, slopes, turned
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import AREA, DIRECTIONAL, ENVIRONMENT, SPOT, EnvironmentMap, Spot
from reference_rt.materials import Emissive
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections

FAINTEST = 1e-12
"""Absolute error, as a fraction of the brightest hit of any light: far above where float32
underflows, and where Mitsuba cuts off microfacet densities (1e-20)."""

REFRACTED = 4.0 * UNIT_ROUNDOFF
"""Absolute error of refracted light, as a fraction of the brightest refracted hit: where F is
nearly 1, 1 - F keeps the rounding of F, some 4 u (measured: 15 % of a value of 5e-8)."""

U_STEP = 2.0**-20
"""Step in (u, v) for the slope of textured lights: float32's error for a light ten times as far
away as it is large."""


def bounds(
    context: LightContext,
    light: int,
    rays: Rays,
    hits: Intersections,
    target: FloatArray,
    values: tuple[FloatArray, FloatArray, FloatArray],
    brightest: float,
) -> FloatArray:
    """(n,): how far float32 may move f cos L.

    Relative to f L, with e the slide of the shaded point and r the light's distance: the normal
    turns by 2 e over the shape's feature size, the direction by e / r; the inverse square changes
    by 2 e / r; and the products round some 16 times.
    """
    value, theirs, their_cosine = values
    sag, of_normal = stand_ins(context, hits)
    e = slide(context.sizes, rays.o, rays.d, hits, sag)
    kind = kind_of(context, light)
    if kind in (ENVIRONMENT, DIRECTIONAL):
        w, distance = target, np.full(len(target), np.inf)
    else:
        w = target - hits.p
        distance = np.linalg.norm(w, axis=1)
    cosine = np.sum(w * hits.ns, axis=1) / np.linalg.norm(w, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        # The cosine may be negative: refracted light arrives from behind.
        ours_full = np.nan_to_num(value.max(axis=1) / np.abs(cosine))
        theirs_full = np.nan_to_num(theirs.max(axis=1) / np.abs(their_cosine))
    turn = 2.0 * e / context.sizes.feature_of(hits) + of_normal
    relative = turn + 4.0 * e / distance + 16.0 * UNIT_ROUNDOFF
    relative += _tables_of(context, hits)
    bound = np.maximum(ours_full, theirs_full) * relative + FAINTEST * brightest
    through = cosine * np.sum(rays.d * hits.ns, axis=1) > 0.0
    bound += np.where(through, REFRACTED * value[through].max(initial=0.0), 0.0)
    if kind == SPOT:
        bound += value.max(initial=0.0) * _rim(context, light)
    return np.asarray(bound)


def _tables_of(context: LightContext, hits: Intersections) -> FloatArray:
    """(n,): relative errors of tabulated materials, see `comparisons.mitsuba.accuracy`."""
    scene = context.scene
    leaf = context.sizes.leaf_of(hits)
    names = [of.material for of in context.sizes.leaves]
    by_leaf = np.array([accuracy(scene, name) for name in names] + [0.0])
    return np.asarray(by_leaf[leaf])


def _rim(context: LightContext, light: int) -> float:
    """The error of Mitsuba's spot falloff: it computes the angle from the cosine, whose rounding
    turns the angle by 4 u over its sine, and divides by the width of the rim."""
    spot = described(context, light)
    assert isinstance(spot, Spot)
    beam = 0.75 * spot.cutoff_angle if spot.beam_width is None else spot.beam_width
    width, sine = np.radians(spot.cutoff_angle - beam), np.sin(np.radians(max(beam, 1.0)))
    if not (width > 0.0 and sine > 0.0):
        return 0.0
    return float(4.0 * UNIT_ROUNDOFF / (sine * width))


def slopes_of(
    context: LightContext,
    light: int,
    u: tuple[float, float],
    rays: Rays,
    hits: Intersections,
    value: FloatArray,
) -> FloatArray:
    """(n,): how much f cos L changes within float32's bound because of highlights and textures:
    measured with our tracer along moved rays, and at moved points of textured lights.

    A mesh that stands in for a shape has other normals.  A normal turned by an angle turns the half
    vector of a highlight as far as a ray does that is turned by twice the angle, or less.
    """
    queries: list[tuple[Rays, tuple[float, float]]] = []
    if is_steep(context.scene):
        sag, of_normal = stand_ins(context, hits)
        radius = context.sizes.frame.delta(rays.o, hits.p, context.sizes.reach_of(hits.shape))
        apart = sag + _slip(context, hits)
        queries += [(other, u) for other in moved(rays, radius + apart)]
        if of_normal.any():
            queries += [(other, u) for other in turned(rays, hits.p, 2.0 * of_normal)]
    if _has_image(context, light):
        for step in (-U_STEP, U_STEP):
            queries += [(rays, (u[0] + step, u[1])), (rays, (u[0], u[1] + step))]

    def value_of(other: Rays, at: tuple[float, float]) -> Callable[[], FloatArray]:
        return lambda: query.direct_light(context.tables, other.o, other.d, light, at).contribution

    others = [value_of(*query_) for query_ in queries]
    return slopes(value, others, float(value.max(initial=0.0)))


def _has_image(context: LightContext, light: int) -> bool:
    """Whether a texture makes the radiance of a light vary over it, or with the direction."""
    kind, scene = kind_of(context, light), context.scene
    if kind == ENVIRONMENT:
        return any(isinstance(described, EnvironmentMap) for described in scene.lights)
    emissive = (m for m in scene.materials.values() if isinstance(m, Emissive))
    return kind == AREA and any(isinstance(m.radiance, str) for m in emissive)


def _slip(context: LightContext, hits: Intersections) -> FloatArray:
    """(n,): how far textures are shifted on meshes that stand in for the shapes that are hit."""
    slip = np.zeros(len(context.scene.shapes) + 1)
    for shape, found in context.counterpart.stand_ins().items():
        slip[shape] = max(s.slip for s in found)
    return np.asarray(slip[hits.shape])


def stand_ins(context: LightContext, hits: Intersections) -> tuple[FloatArray, FloatArray]:
    """(n,) each: the distance and the normal's angle between the shape that was hit and the mesh
    that stands in for it; 0 without such a mesh."""
    sag, turn = np.zeros((2, len(context.scene.shapes) + 1))
    for shape, found in context.counterpart.stand_ins().items():
        sag[shape], turn[shape] = max(s.sag for s in found), max(s.turn for s in found)
    return sag[hits.shape], turn[hits.shape]
