"""The second rung: direct light, one light at a time."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from comparisons.accuracy import accuracy
from comparisons.answers import rows_of
from comparisons.mitsuba_backend import mitsuba
from comparisons.mitsuba_plugins.whitted import emitted, without
from comparisons.mitsuba_scene import for_rays, light_id
from comparisons.results import Tier
from comparisons.tiers import arbiter
from comparisons.tiers.bounds import UNIT_ROUNDOFF, ShapeSizes, delta, largest, slide
from comparisons.tiers.rays import RAY_EPSILON, SHADOW_EPSILON, Rays, mixed_rays
from comparisons.tiers.slopes import is_steep, moved, slopes
from comparisons.twin import Twin
from reference_rt import query
from reference_rt.lights import (
    AREA,
    DIRECTIONAL,
    ENVIRONMENT,
    POINT,
    SPOT,
    Directional,
    EnvironmentMap,
    Point,
    Spot,
)
from reference_rt.materials import SMOOTH, Emissive
from reference_rt.query import DirectLight, Intersections
from reference_rt.scene import Scene
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.tables import SceneTables

PIXELS = 1024
"""Camera rays at most; as many random and secondary rays join them."""

LIGHTS = 8
"""Lights that are tested at most, evenly spread over the scene's."""

POINTS = ((0.5, 0.4), (0.13, 0.71), (0.83, 0.22), (0.37, 0.93))
"""(u, v) that pick a point on a light: none on the edge of a face of any shape."""


POINT_LIKE: dict[int, type] = {POINT: Point, SPOT: Spot, DIRECTIONAL: Directional}
"""What Mitsuba's emitters tell of themselves, by kind: these have one direction."""

FAINTEST = 1e-12
"""Of the brightest hit of a light: float32 ends, and Mitsuba's microfacets where fewer than 1e-20
of them face a direction, long after that."""

REFRACTED = 4.0 * UNIT_ROUNDOFF
"""Of the brightest refracted hit, for these alone: where nearly everything is mirrored 1 - F keeps
the rounding of F, some four times that of 1 (measured: 15 % of a value of 5e-8)."""

U_STEP = 2.0**-20
"""How far points on lights with textures are moved, in their own coordinates: what float32 does to
a light ten times as far away as it is large."""


class Setting(NamedTuple):
    """What all lights of a scene share: the rays, what they hit, the sizes behind the bounds."""

    scene: Scene
    tables: SceneTables
    twin: Twin
    rays: Rays
    hits: Intersections
    sizes: ShapeSizes


class Outcome(NamedTuple):
    """One light point: rays compared, the rays that differ unexplained, how many are explained, the
    largest error and the largest error over its bound of the rest."""

    rays: int
    unexplained: IntArray
    explained: int
    max_error: float
    max_ratio: float


def direct(
    scene: Scene, tables: SceneTables, twin: Twin, pixels: int = PIXELS, seed: int = 0
) -> Tier:
    """Compare f cos L of single lights at what camera, random and secondary rays hit.

    At most LIGHTS of the scene's lights, at POINTS each.  Where ours is lit and Mitsuba's is not,
    or the reverse, the arbiter repeats Mitsuba's shadow ray, with its epsilons, in our tracer.
    """
    choice = tables.lights.choice
    if choice is None:
        return Tier("direct", "not-applicable", "the scene has no light")
    if twin.lacking:
        return Tier("direct", "not-comparable", twin.lacking)
    if not (tables.materials.traits & SMOOTH).any():
        return Tier("direct", "not-applicable", "no material scatters light that a light sends")
    sizes = ShapeSizes(scene)
    rays = mixed_rays(scene, tables, sizes, pixels, seed)
    hits = query.intersect(tables, rays.o, rays.d)
    setting = Setting(scene, tables, twin, rays, hits, sizes)
    lights = np.flatnonzero(choice.probability > 0.0)
    count = len(lights)
    tested = lights[np.unique(np.linspace(0, count - 1, min(count, LIGHTS)).round().astype(int))]
    outcomes: dict[tuple[int, tuple[float, float]], Outcome] = {}
    for light in tested.tolist():
        points = POINTS[:1] if choice.kind[light] in POINT_LIKE else POINTS
        for u in points:
            outcomes[light, u] = _compare(setting, light, u)
    total = sum(o.rays for o in outcomes.values())
    explained = sum(o.explained for o in outcomes.values())
    unexplained = sum(len(o.unexplained) for o in outcomes.values())
    numbers: dict[str, Any] = {
        "rays": total,
        "lights": count,
        "lights_tested": len(tested),
        "explained": explained,
        "unexplained": unexplained,
        "max_error": max(o.max_error for o in outcomes.values()),
        "max_error_over_bound": max(o.max_ratio for o in outcomes.values()),
    }
    for (light, u), outcome in outcomes.items():
        if len(outcome.unexplained):
            k = int(outcome.unexplained[0])
            reason = (
                f"{unexplained} of {total} differ; the first: light {light} at u = {u}, the ray "
                f"from {rays.o[k].tolist()} along {rays.d[k].tolist()}"
            )
            return Tier("direct", "differ", reason, numbers)
    shadows = f"{explained} of {total} lie on edges or in reach of Mitsuba's shadow epsilon"
    if explained > arbiter.LIMIT * total:
        return Tier("direct", "reference-limited", shadows, numbers)
    reason = f"{len(tested)} of {count} lights agree to {numbers['max_error_over_bound']:.2g} of "
    return Tier("direct", "agree", f"{reason}float32's bound; {shadows}", numbers)


def _compare(setting: Setting, light: int, u: tuple[float, float]) -> Outcome:
    """One point of one light at all hits."""
    rays, hits, tables = setting.rays, setting.hits, setting.tables
    ours = query.direct_light(tables, rays.o, rays.d, light, u)
    target = _targets(ours)
    known = np.flatnonzero((hits.shape >= 0) & np.isfinite(target).all(axis=1))
    if len(known) == 0:
        return Outcome(0, known, 0, 0.0, 0.0)
    rays, hits, target = Rays(rays.o[known], rays.d[known]), rows_of(hits, known), target[known]
    value = ours.contribution[known]
    theirs, their_cosine = _mitsuba_direct(setting, light, rays, target)
    bound = _bounds(setting, light, rays, hits, target, (value, theirs, their_cosine))
    bound += _slopes(setting, light, u, rays, hits, value)
    error = np.abs(theirs - value).max(axis=1)
    wrong = np.flatnonzero(~(error <= bound))

    def like_theirs(numbers: IntArray, offsets: FloatArray) -> arbiter.BoolArray:
        there = query.direct_light(
            tables, rays.o[numbers] + offsets, rays.d[numbers], light, u
        ).contribution
        # The move itself shifts the value by as much as the bound: twice is allowed.
        apart = np.abs(there - theirs[numbers]).max(axis=1)
        dark = ~theirs[numbers].any(axis=1)
        lit_differs = value[numbers].any(axis=1) == dark
        now_dark = _dark(setting, light, rows_of(hits, numbers), target[numbers], offsets)
        return np.asarray((apart <= 2.0 * bound[numbers]) | (lit_differs & (now_dark == dark)))

    radius = delta(rays.o, hits.p, setting.sizes.reach_of(hits.shape))
    radius += _stand_ins(setting, hits)[0]
    settled = arbiter.explained(wrong, radius[wrong], like_theirs)
    right = error <= bound
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num(error[right] / bound[right])
    return Outcome(
        rays=len(known),
        unexplained=known[wrong[~settled]],
        explained=int(np.count_nonzero(settled)),
        max_error=float(error[right].max(initial=0.0)),
        max_ratio=float(ratio.max(initial=0.0)),
    )


def _targets(ours: DirectLight) -> FloatArray:
    """(n, 3) the point on the light for each ray; NaN where it is not known.

    Ours tells none where nothing can arrive.  A light whose point is the same for all rays is
    asked about there too: Mitsuba's has to be dark as well.
    """
    seen = ours.pdf > 0.0
    target = np.full_like(ours.target, np.nan)
    target[seen] = ours.target[seen]
    if seen.any() and np.ptp(ours.target[seen], axis=0).max() == 0.0:
        target[:] = ours.target[seen][0]
    return target


def _bounds(
    setting: Setting,
    light: int,
    rays: Rays,
    hits: Intersections,
    target: FloatArray,
    values: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:
    """(n,): how far float32 may move f cos L.

    With E = f L, e the slide of the shaded point and r the light's distance: the cosine is off by
    the turn of the normal, 2 e over the shape's feature, and of the direction, e / r; the inverse
    square by 2 e / r; and the products round some 16 times.
    """
    value, theirs, their_cosine = values
    sag, of_normal = _stand_ins(setting, hits)
    e = slide(setting.sizes, rays.o, rays.d, hits, sag)
    kind = _kind(setting, light)
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
    bound = np.maximum(ours_full, theirs_full) * relative + FAINTEST * value.max(initial=0.0)
    through = cosine * np.sum(rays.d * hits.ns, axis=1) > 0.0
    bound += np.where(through, REFRACTED * value[through].max(initial=0.0), 0.0)
    if kind == SPOT:
        bound += value.max(initial=0.0) * _rim(setting, light)
    return np.asarray(bound)


def _tables_of(setting: Setting, hits: Intersections) -> FloatArray:
    """(n,): how far tables of materials are off, see `comparisons.accuracy`."""
    scene = setting.scene
    leaf = setting.sizes.leaf_of(hits)
    names = [of.material for of in setting.sizes.leaves]
    by_leaf = np.array([accuracy(scene, name) for name in names] + [0.0])
    return np.asarray(by_leaf[leaf])


def _rim(setting: Setting, light: int) -> float:
    """How far Mitsuba's falloff of a spot is off: it has the angle from the cosine, whose rounding
    turns the angle by 4 u over its sine, and divides by the width of the rim."""
    spot = _described(setting, light)
    assert isinstance(spot, Spot)
    beam = 0.75 * spot.cutoff_angle if spot.beam_width is None else spot.beam_width
    width, sine = np.radians(spot.cutoff_angle - beam), np.sin(np.radians(max(beam, 1.0)))
    if not (width > 0.0 and sine > 0.0):
        return 0.0
    return float(4.0 * UNIT_ROUNDOFF / (sine * width))


def _slopes(
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
        radius = delta(rays.o, hits.p, setting.sizes.reach_of(hits.shape))
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
    kind, scene = _kind(setting, light), setting.scene
    if kind == ENVIRONMENT:
        return any(isinstance(described, EnvironmentMap) for described in scene.lights)
    emissive = (m for m in scene.materials.values() if isinstance(m, Emissive))
    return kind == AREA and any(isinstance(m.radiance, str) for m in emissive)


def _stand_ins(setting: Setting, hits: Intersections) -> tuple[FloatArray, FloatArray]:
    """(n,) each: how far the meshes that stand for shapes are off these, and their normals."""
    sag, turn = np.zeros((2, len(setting.scene.shapes) + 1))
    for shape, found in setting.twin.stand_ins().items():
        sag[shape], turn[shape] = max(s.sag for s in found), max(s.turn for s in found)
    return sag[hits.shape], turn[hits.shape]


def _kind(setting: Setting, light: int) -> int:
    choice = setting.tables.lights.choice
    return -1 if choice is None else int(choice.kind[light])


# ---- Mitsuba's side -----------------------------------------------------------------------------


def _mitsuba_direct(
    setting: Setting, light: int, rays: Rays, target: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """f cos L (n, 3) and the cosine at the surface (n,): Mitsuba's hit, BSDF, visibility, light."""
    import drjit as dr

    mi, scene, kind = mitsuba(), setting.twin.mi_scene, _kind(setting, light)
    emitter = _point_emitter(setting, light) if kind in POINT_LIKE else None
    is_far = kind in (ENVIRONMENT, DIRECTIONAL)

    def value(o: Any, d: Any, at: Any) -> tuple[Any, ...]:
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(o), d))
        active = si.is_valid()
        if not dr.any(active):
            return mi.Color3f(0.0), mi.Float(0.0)
        wi = at if is_far else dr.normalize(at - si.p)
        ray = si.spawn_ray(wi) if is_far else si.spawn_ray_to(mi.Point3f(at))
        visible = without(active, scene.ray_test(ray, active))
        if emitter is not None:
            sample, radiance = emitter.sample_direction(si, mi.Point2f(0.5, 0.5), active)
            wi = sample.d
        else:
            ray.maxt = dr.inf
            # Behind the shadow test's end there must be the light itself, its front towards us.
            found = scene.ray_intersect(ray, visible)
            radiance = emitted(mi, scene, found, visible)
        local = si.to_local(wi)
        f_cos = si.bsdf().eval(mi.BSDFContext(), si, local, visible)
        return dr.select(visible, f_cos * radiance, 0.0), local.z

    contribution, cosine = for_rays(value, rays.o, rays.d, target)
    return contribution, cosine


def _described(setting: Setting, light: int) -> Any:
    """The description of a light that is a point or a direction."""
    return setting.scene.lights[_number(setting, light)]


def _number(setting: Setting, light: int) -> int:
    """Its place in the scene's lights: rows of our tables count those of its kind."""
    choice = setting.tables.lights.choice
    row = 0 if choice is None else int(choice.row[light])
    described = POINT_LIKE[_kind(setting, light)]
    return [i for i, x in enumerate(setting.scene.lights) if isinstance(x, described)][row]


def _point_emitter(setting: Setting, light: int) -> Any:
    """Mitsuba's emitter of such a light."""
    wanted = light_id(_number(setting, light))
    for emitter in setting.twin.mi_scene.emitters():
        if emitter.id() == wanted:
            return emitter
    raise LookupError(f"Mitsuba's scene has no emitter {wanted}")


def _dark(
    setting: Setting, light: int, hits: Intersections, target: FloatArray, offsets: FloatArray
) -> arbiter.BoolArray:
    """Whether ours finds Mitsuba's shadow ray dark: begun and ended as Mitsuba does it."""
    kind = _kind(setting, light)
    is_far = kind in (ENVIRONMENT, DIRECTIONAL)
    w = target if is_far else target - hits.p
    side = np.where(np.sum(w * hits.n, axis=1) < 0.0, -1.0, 1.0)
    height = side * (1.0 + largest(hits.p)) * RAY_EPSILON
    o = hits.p + hits.n * height[:, None] + offsets
    if is_far:
        return query.occluded(setting.tables, o, w)
    if kind in POINT_LIKE:
        return query.occluded(setting.tables, o, target - o, 1.0 - SHADOW_EPSILON)
    # Seen from the moved origin a light may turn its back, or its rim be missed.
    met = query.intersect(setting.tables, o, target - o)
    facing = np.sum(met.n * (target - o), axis=1) < 0.0
    return np.asarray((met.t < 1.0 - SHADOW_EPSILON) | ~facing)
