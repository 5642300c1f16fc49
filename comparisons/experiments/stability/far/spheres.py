"""F1's rays at spheres, and the contestants' answers."""

import numpy as np

from comparisons.experiments.stability.harness.in_mitsuba import traced
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    Columns,
    FloatArray,
    Outcome,
    Outcomes,
    U,
    outcome,
    plain,
)
from comparisons.experiments.stability.harness.rays import Rays
from comparisons.experiments.stability.harness.series import Draw
from comparisons.geometry.affine import across, unit_vectors
from comparisons.geometry.exact import KINDS, first_of
from comparisons.geometry.exact.dyadic import (
    FRACTION,
    NEVER,
    BoolArray,
    Dyadic,
    Fixed,
    dot,
    nearest,
)
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import scalar
from reference_rt import textbook
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Sphere
from reference_rt.shapes.curved.sphere import distance as rendering
from reference_rt.shapes.shape import Shape
from reference_rt.textbook.method import ray_of
from reference_rt.textbook.sphere import algebraic, geometric, robust

# ---- exact answers and error bounds: what F1 judges hits by --------------------------------------


BAND = 5.0
"""u r: a line that passes the rim of a sphere by less is undecidable.

The closest approach p rounds twice in each coordinate, |p|² and r² as numbers of their own size:
r² - |p|² + (p·d)²/a is off by 2·2 u r² + 3 u r² + u r² + 2 u r², and r - |p| by half of that over
r.  Nothing here grows with the distance, nor with the offset.
"""

U_SINGLE = 2.0**-24
"""u of float32: Mitsuba is judged by the same law with this."""

ROUNDINGS = 16.0
"""u (|t| |d| + D) that t |d| may be off by besides: the issue's number.  c / q rounds by some 10 u
of itself."""


def apart(t: FloatArray, exact: Fixed) -> FloatArray:
    """|t - exact|; the difference is taken before it is rounded.  All finite."""
    return nearest(np.abs(Dyadic.of(t).to(min(Dyadic.of(t).e, -FRACTION)).n - exact))


def gaps(rays: Rays) -> FloatArray:
    """(r - |closest approach|) / r of spheres' rays: above 0 for a hit.  Exact to a rounding."""
    f = Dyadic.of(rays.o) - Dyadic.of(rays.row["center"])
    d, r = Dyadic.of(rays.d), Dyadic.of(rays.row["radius"])
    a, b = dot(d, d), dot(f, d)
    scale = r * r * a
    relative = ((r * r - dot(f, f)) * a + b * b).floats() / scale.floats()
    return np.asarray(relative / (1.0 + np.sqrt(np.maximum(1.0 - relative, 0.0))))


class Truth:
    """The truth about rays at spheres, computed once for all contestants.

    u: the contestant's unit roundoff.  Within BAND u of the rim either answer is right, unless
    `strict`; t |d| may be off by ROUNDINGS u (|t| |d| + D) and by what the band makes of half the
    chord h: BAND u r² / h.
    """

    def __init__(self, rays: Rays, u: float = U, strict: bool = False) -> None:
        self.rays, band = rays, BAND * u
        crossings = KINDS["spheres"](rays.row, Dyadic.of(rays.o), Dyadic.of(rays.d))
        self.hit = first_of(crossings)
        self.gap = gaps(rays)
        self.open = (np.abs(self.gap) <= (0.0 if strict else band)) | self.hit.touching
        t = np.where(np.isfinite(self.hit.t), self.hit.t, 0.0)
        chord = rays.size * np.sqrt(np.maximum(self.gap * (2.0 - self.gap), band))
        self.bound = ROUNDINGS * u * (t * rays.speed() + rays.distance())
        self.bound += band * rays.size**2 / chord

    def judge(self, t: FloatArray) -> Outcome:
        return _outcome(self.rays, self.hit.t, self.hit.fixed, t, self.open, self.bound, self.gap)


def _outcome(
    rays: Rays,
    exact: FloatArray,
    fixed: Fixed,
    t: FloatArray,
    is_open: BoolArray,
    bound: FloatArray,
    gap: FloatArray | None = None,
) -> Outcome:
    t = np.where(np.isnan(t) | (t < 0.0), -1.0, t)  # neither a hit nor a miss
    both = np.isfinite(exact) & np.isfinite(t) & ~is_open
    share = np.zeros(len(t))
    share[both] = apart(t[both], fixed[both]) * rays.speed()[both] / bound[both]
    wrong = (np.isfinite(exact) != np.isfinite(t)) | (share > 1.0)
    worst = float(share[both].max()) if both.any() else None
    columns: Columns = {"kind": rays.kind, **rays.columns(), "expected": exact, "t": t}
    if gap is not None:
        columns["gap"] = plain(gap)
    return outcome(wrong, columns, is_open, worst)


DIRECTIONS = 8
"""Across a ray in which it is moved: one is within 22.5 degrees of a surface's normal."""

MOVED = 64.0
"""u times the size of a shape that is not a sphere: a ray's answer is right if it is that of a ray
which passes no further beside it.

Where the ray is next to the shape, in its own coordinates, 3 products round there and back (8 u for
a map that stretches by 4), the ten terms of f 9 times each, on numbers up to 4 times the size.
"""


def judge_by_moving(rays: Rays, t: FloatArray, u: float = U) -> Outcome:
    """Backward: right is what is exact for a ray that passes at most MOVED u sizes beside this
    one, but for ROUNDINGS u (|t| |d| + D) in t |d|.

    Open are the hits and misses that are so, but not without moving.
    """
    hit = first_of(KINDS[rays.kind](rays.row, Dyadic.of(rays.o), Dyadic.of(rays.d)))
    speed = rays.speed()
    bound = ROUNDINGS * u * (np.where(np.isfinite(hit.t), hit.t, 0.0) * speed + rays.distance())
    t = np.where(np.isnan(t) | (t < 0.0), -1.0, t)
    both = np.isfinite(hit.t) & np.isfinite(t)
    off = np.zeros(len(t))
    off[both] = apart(t[both], hit.fixed[both]) * speed[both]
    doubtful = np.flatnonzero((np.isfinite(hit.t) != np.isfinite(t)) | (off > bound))
    is_open = hit.touching.copy()
    low, high, some_miss = _moved(rays.only(doubtful), MOVED * u)
    for k, i in enumerate(doubtful.tolist()):
        if both[i]:
            spread = max(high[k] - hit.fixed[i], hit.fixed[i] - low[k]) if high[k] > 0 else 0
            bound[i] += float(nearest(np.array([spread], dtype=object))[0]) * speed[i]
        elif np.isfinite(t[i]):
            near = high[k] > 0 and _within(t[i], low[k], high[k], bound[i] / speed[i])
            is_open[i] |= bool(near)
        else:
            is_open[i] |= bool(some_miss[k])
    return _outcome(rays, hit.t, hit.fixed, t, is_open, bound)


def _within(t: float, low: int, high: int, slack: float) -> bool:
    found, margin = (int(n) >> FRACTION for n in Dyadic.of([t, slack]).to(-2 * FRACTION).n)
    return low - margin <= found <= high + margin


def _moved(rays: Rays, by: float) -> tuple[list[int], list[int], BoolArray]:
    """(the least and the largest t, 0 without hits, whether some miss) over all ways to move."""
    n = len(rays.o)
    low, high, some_miss = [int(NEVER)] * n, [0] * n, np.zeros(n, bool)
    if n == 0:
        return low, high, some_miss
    unit = rays.d / rays.speed()[:, None]
    axis = np.eye(3)[np.argmin(np.abs(unit), axis=1)]
    first = np.cross(unit, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(unit, first)
    o, d = Dyadic.of(rays.o), Dyadic.of(rays.d)
    for angle in 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        step = (first * np.cos(angle) + second * np.sin(angle)) * (by * rays.size)[:, None]
        found = first_of(KINDS[rays.kind](rays.row, o + Dyadic.of(step), d))
        for k, (fixed, t) in enumerate(zip(found.fixed.tolist(), found.t, strict=True)):
            if np.isfinite(t):
                low[k], high[k] = min(low[k], fixed), max(high[k], fixed)
            else:
                some_miss[k] = True
    return low, high, some_miss


WHO = (OURS, *textbook.names("sphere"))
"""Contestants beside Mitsuba: `_answer` takes their index."""

SCENES = 8
"""Mitsuba's scenes at a sweep point, each of one shape."""

RAYS = 2000
"""Rays that Mitsuba traces at a sweep point, spread over SCENES scenes."""


def draw_rays(
    rng: np.random.Generator,
    distance: FloatArray,
    gap: FloatArray,
    offset: float = 0.0,
    radius: float = 1.0,
) -> Rays:
    """Rays from `distance` (n,) radii that pass the rims of spheres of about this radius, by `gap`
    (n,) radii within (above 0) or beyond it.

    Rounding a ray that comes from afar moves it by many times the smallest gaps: the spheres' radii
    are chosen afterwards, each for its ray.  `offset`: of the centres, in radii.
    """
    n = len(distance)
    center = radius * (offset * unit_vectors(rng, n) + rng.uniform(-1.0, 1.0, (n, 3)))
    out = unit_vectors(rng, n)
    o = center + out * (distance * radius)[:, None]
    # The foot of the perpendicular is that near, seen from the origin under this angle.
    aim = np.minimum(1.0 - gap, 0.9 * distance)
    reach = distance * np.tan(np.arcsin(aim / distance)) * radius
    d = (center + across(rng, out) * reach[:, None] - o) * 10.0 ** rng.uniform(-3.0, 3.0, (n, 1))
    size = _approach(o, d, center) / (1.0 - gap)
    return Rays("spheres", {"center": center, "radius": size}, size, o, d)


def _approach(o: FloatArray, d: FloatArray, center: FloatArray) -> FloatArray:
    """How near lines pass, rounded once or twice."""
    f, e = Dyadic.of(o) - Dyadic.of(center), Dyadic.of(d)
    a, b = dot(e, e), dot(f, e)
    return np.asarray(np.sqrt((dot(f, f) * a - b * b).floats() / a.floats()))


def mixed_gaps(rng: np.random.Generator, n: int) -> FloatArray:
    """Half clear of the rim, half from 2^-1 to 2^-40 within or beyond it."""
    return np.where(rng.random(n) < 0.5, clear_gaps(rng, n), tangent_gaps(rng, n))


def clear_gaps(rng: np.random.Generator, n: int) -> FloatArray:
    """Three rays in four pass within 0.95 radii of the centre, the others at 1.05 to 1.5."""
    within = 1.0 - 0.95 * np.sqrt(rng.random(n))
    return np.where(rng.random(n) < 0.75, within, -rng.uniform(0.05, 0.5, n))


def tangent_gaps(rng: np.random.Generator, n: int) -> FloatArray:
    return np.asarray(rng.choice([-1.0, 1.0], n) * 2.0 ** -rng.uniform(1.0, 40.0, n))


def answers(rays: Rays) -> dict[str, FloatArray]:
    """t (n,) by our kernel and by the textbook's methods, inf for a miss."""
    found = {}
    with np.errstate(all="ignore"):
        for number, name in enumerate(WHO):
            found[name] = np.empty(len(rays.o))
            columns = (rays.row["center"], rays.row["radius"], rays.o, rays.d, found[name])
            _answer(number, *columns)
    return found


@entry_kernel
def _answer(
    who: int,
    center: FloatArray,
    radius: FloatArray,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
) -> None:
    for i in range(len(o)):
        ray, c, r = ray_of(o, d, i), row(center, i), radius[i]
        if who == 0:
            t[i] = rendering(ray, c, r)
        elif who == 1:
            t[i] = algebraic(ray, c, r)
        elif who == 2:
            t[i] = geometric(ray, c, r)
        else:
            t[i] = robust(ray, c, r)


def in_mitsuba(shape: Shape, o: FloatArray, d: FloatArray) -> FloatArray:
    """t (n,); in its scalar variant no mesh stands in for what is small."""
    return traced(Scene(shapes=(shape,)), o, d).t


def for_mitsuba(rays: Rays) -> Rays:
    """The first RAYS rays at SCENES different spheres, rounded to float32; directions are of unit
    length, as Mitsuba's own are."""
    few = rays.only(np.arange(min(RAYS, len(rays.o))))
    which = np.arange(len(few.o)) % SCENES
    center = few.row["center"][which]
    o, d = few.o - few.row["center"] + center, few.d / few.speed()[:, None]
    size = round32(few.size[which])
    return Rays(
        "spheres", {"center": round32(center), "radius": size}, size, round32(o), round32(d)
    )


def mitsubas(rays: Rays) -> FloatArray:
    t = np.empty(len(rays.o))
    with scalar():
        for k in range(min(SCENES, len(t))):
            center, radius = rays.row["center"][k].tolist(), float(rays.row["radius"][k])
            shape = Sphere(center=tuple(center), radius=radius)
            t[k::SCENES] = in_mitsuba(shape, rays.o[k::SCENES], rays.d[k::SCENES])
    return t


def compete(draw: Draw, rays: Rays, strict: bool = False) -> Outcomes:
    """All on the same rays; Mitsuba on some of them, rounded to float32 with their spheres, against
    the exact answer for these and the law in float32's u.  strict: see `Truth`."""
    truth = Truth(rays, strict=strict)
    found = {name: truth.judge(t) for name, t in answers(rays).items()}
    if draw.mitsuba:
        rounded = for_mitsuba(rays)
        found[MITSUBA] = Truth(rounded, U_SINGLE, strict).judge(mitsubas(rounded))
    return found
