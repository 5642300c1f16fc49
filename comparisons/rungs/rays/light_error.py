"""How far float32 may move f cos L of one light: what the rung of direct light allows."""

from collections.abc import Callable

import numpy as np

from comparisons.mitsuba.accuracy import accuracy
from comparisons.rungs.rays.bounds import UNIT_ROUNDOFF, slide
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.setting import Setting, described, kind_of
from comparisons.rungs.rays.slopes import is_steep, moved, slopes
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import AREA, DIRECTIONAL, ENVIRONMENT, SPOT, EnvironmentMap, Spot
from reference_rt.materials import Emissive
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections

FAINTEST = 1e-12
"""Of the brightest hit of any light: float32 ends, and Mitsuba's microfacets where fewer than 1e-20
of them face a direction, long after that."""

REFRACTED = 4.0 * UNIT_ROUNDOFF
"""Of the brightest refracted hit, for these alone: where nearly everything is mirrored 1 - F keeps
the rounding of F, some four times that of 1 (measured: 15 % of a value of 5e-8)."""

U_STEP = 2.0**-20
"""How far points on lights with textures are moved, in their own coordinates: what float32 does to
a light ten times as far away as it is large."""


def bounds(
    setting: Setting,
    light: int,
    rays: Rays,
    hits: Intersections,
    target: FloatArray,
    values: tuple[FloatArray, FloatArray, FloatArray],
    brightest: float,
) -> FloatArray:
    """(n,): how far float32 may move f cos L.

    With E = f L, e the slide of the shaded point and r the light's distance: the cosine is off by
    the turn of the normal, 2 e over the shape's feature, and of the direction, e / r; the inverse
    square by 2 e / r; and the products round some 16 times.
    """
    value, theirs, their_cosine = values
    sag, of_normal = stand_ins(setting, hits)
    e = slide(setting.sizes, rays.o, rays.d, hits, sag)
    kind = kind_of(setting, light)
    if kind in (ENVIRONMENT, DIRECTIONAL):
        w, distance = target, np.full(len(target), np.inf)
    else:
        w = target - hits.p
        distance = np.linalg.norm(w, axis=1)
    cosine = np.sum(w * hits.ns, axis=1) / np.linalg.norm(w, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Of either sign: what is refracted arrives from behind.
        ours_full = np.nan_to_num(value.max(axis=1) / np.abs(cosine))
        theirs_full = np.nan_to_num(theirs.max(axis=1) / np.abs(their_cosine))
    turn = 2.0 * e / setting.sizes.feature_of(hits) + of_normal
    relative = turn + 4.0 * e / distance + 16.0 * UNIT_ROUNDOFF
    relative += _tables_of(setting, hits)
    bound = np.maximum(ours_full, theirs_full) * relative + FAINTEST * brightest
    through = cosine * np.sum(rays.d * hits.ns, axis=1) > 0.0
    bound += np.where(through, REFRACTED * value[through].max(initial=0.0), 0.0)
    if kind == SPOT:
        bound += value.max(initial=0.0) * _rim(setting, light)
    return np.asarray(bound)


def _tables_of(setting: Setting, hits: Intersections) -> FloatArray:
    """(n,): how far tables of materials are off, see `comparisons.mitsuba.accuracy`."""
    scene = setting.scene
    leaf = setting.sizes.leaf_of(hits)
    names = [of.material for of in setting.sizes.leaves]
    by_leaf = np.array([accuracy(scene, name) for name in names] + [0.0])
    return np.asarray(by_leaf[leaf])


def _rim(setting: Setting, light: int) -> float:
    """How far Mitsuba's falloff of a spot is off: it has the angle from the cosine, whose rounding
    turns the angle by 4 u over its sine, and divides by the width of the rim."""
    spot = described(setting, light)
    assert isinstance(spot, Spot)
    beam = 0.75 * spot.cutoff_angle if spot.beam_width is None else spot.beam_width
    width, sine = np.radians(spot.cutoff_angle - beam), np.sin(np.radians(max(beam, 1.0)))
    if not (width > 0.0 and sine > 0.0):
        return 0.0
    return float(4.0 * UNIT_ROUNDOFF / (sine * width))


def slopes_of(
    setting: Setting,
    light: int,
    u: tuple[float, float],
    rays: Rays,
    hits: Intersections,
    value: FloatArray,
) -> FloatArray:
    """(n,): how far float32's bound moves what highlights and textures send, by asking ours along
    moved rays, and for moved points of lights with textures."""
    asked: list[tuple[Rays, tuple[float, float]]] = []
    if is_steep(setting.scene):
        radius = setting.sizes.frame.delta(rays.o, hits.p, setting.sizes.reach_of(hits.shape))
        asked += [(other, u) for other in moved(rays, radius)]
    if _has_image(setting, light):
        for step in (-U_STEP, U_STEP):
            asked += [(rays, (u[0] + step, u[1])), (rays, (u[0], u[1] + step))]

    def value_of(other: Rays, at: tuple[float, float]) -> Callable[[], FloatArray]:
        return lambda: query.direct_light(setting.tables, other.o, other.d, light, at).contribution

    others = [value_of(*one) for one in asked]
    return slopes(value, others, float(value.max(initial=0.0)))


def _has_image(setting: Setting, light: int) -> bool:
    """Whether what a light sends depends on where it is seen by a texture."""
    kind, scene = kind_of(setting, light), setting.scene
    if kind == ENVIRONMENT:
        return any(isinstance(described, EnvironmentMap) for described in scene.lights)
    emissive = (m for m in scene.materials.values() if isinstance(m, Emissive))
    return kind == AREA and any(isinstance(m.radiance, str) for m in emissive)


def stand_ins(setting: Setting, hits: Intersections) -> tuple[FloatArray, FloatArray]:
    """(n,) each: how far the meshes that stand for shapes are off these, and their normals."""
    sag, turn = np.zeros((2, len(setting.scene.shapes) + 1))
    for shape, found in setting.twin.stand_ins().items():
        sag[shape], turn[shape] = max(s.sag for s in found), max(s.turn for s in found)
    return sag[hits.shape], turn[hits.shape]
