"""F1's rays at spheres, and the contestants' answers."""

import numpy as np

from comparisons.experiments.stability.far.law import Truth
from comparisons.experiments.stability.harness.in_mitsuba import traced
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    unit_of,
)
from comparisons.experiments.stability.harness.rays import Rays
from comparisons.experiments.stability.harness.series import Draw
from comparisons.geometry.affine import across, unit_vectors
from comparisons.geometry.exact.dyadic import Dyadic, dot
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
        found[MITSUBA] = Truth(rounded, unit_of(MITSUBA), strict).judge(mitsubas(rounded))
    return found
