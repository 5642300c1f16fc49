"""Solid angles of spheres, implied by the densities of light samples."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from flint import arb

from comparisons.experiments.stability.harness.exactly import cross, dot, exactly
from comparisons.experiments.stability.harness.meshes import mitsuba_mesh
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    Columns,
    FloatArray,
    Outcomes,
    of_errors,
    plain,
    relative,
    together,
    unit_of,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.curved import sphere
from reference_rt.shapes.curved.sphere import Sphere
from reference_rt.shapes.flat import rectangle
from reference_rt.shapes.flat.rectangle import Rectangle
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.meshes.triangle import Triangle
from reference_rt.shapes.shape import TabulationContext

TEXTBOOK = "sphere.cosine"


@entry_kernel
def _of_sphere(table: Any, p: Any, u: Any, out: Any) -> None:
    for i in range(len(p)):
        for k in range(u.shape[1]):
            out[i, k] = sphere.sample(table, 0, 0.0, row(p, i), u[i, k, 0], u[i, k, 1]).pdf


def theirs(shape: dict[str, Any] | Any, p: FloatArray, u: FloatArray) -> FloatArray:
    """Densities (n, k) of Mitsuba's samples of a shape."""
    import drjit as dr

    mi = mitsuba()
    loaded = mi.load_dict(shape) if isinstance(shape, dict) else shape

    def density(at: Any, v: Any) -> tuple[Any, ...]:
        it = dr.zeros(mi.SurfaceInteraction3f)
        it.p = mi.Point3f(at)
        it.t = 1.0
        return (loaded.sample_direction(it, mi.Point2f(v.x, v.y)).pdf,)

    points = np.repeat(p, u.shape[1], axis=0)
    numbers = np.minimum(np.pad(u.reshape(-1, 2), ((0, 0), (0, 1))), 1.0 - 2.0**-24)
    return np.asarray(for_rays(density, points, numbers)[0].reshape(u.shape[:2]))


def _cap(at: list[arb]) -> tuple[arb, arb]:
    """The solid angle of the unit sphere, and the cosine of half its cone."""
    d2 = dot(at, at)
    cosine = (1 - 1 / d2).sqrt() if d2 > 1 else arb(0)
    return 2 * arb.pi() * (1 / d2) / (1 + cosine), cosine


def _sphere(draw: Draw, gap: FloatArray, shared: bool) -> Outcomes:
    """The unit sphere from 1 + gap."""
    p = np.ascontiguousarray(unit_vectors(draw.rng, len(gap)) * (1.0 + gap)[:, None])
    p = round32(p) if shared else p
    truth, cosine = exactly(_cap, p).T
    out = np.empty((len(p), 1))
    u = draw.rng.uniform(0.0, 1.0, (len(p), 1, 2))
    _of_sphere(Sphere().tabulate(TabulationContext()), p, u, out)
    d2 = (p * p).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        naive = 2.0 * math.pi * (1.0 - np.sqrt(1.0 - 1.0 / d2))
        found = {OURS: 1.0 / out[:, 0], TEXTBOOK: naive}
        if draw.mitsuba and shared:
            found[MITSUBA] = 1.0 / theirs({"type": "sphere"}, p, u)[:, 0]
    outcomes = {}
    for who, value in found.items():
        shown: Columns = {"sphere": "of radius 1 at the origin", "point": p}
        shown |= {"solid angle": plain(truth), "found": plain(value)}
        allowed = 16.0 * unit_of(who) * (1.0 + 1.0 / np.maximum(cosine, 1e-300))
        outcomes[who] = of_errors(relative(value, truth), allowed, shown)
    return outcomes


@series(
    Sweep("1 / solid angle", decades(0, 12), (1.0, 1e6, 1e12), 1_000, 20_000), unit="of the value"
)
def small_spheres(draw: Draw, x: float) -> Outcomes:
    """The solid angle that light samples of a sphere stand for, seen from afar."""
    omega = draw.rng.uniform(1.0, 2.0, draw.cases) / x
    return _sphere(draw, np.sqrt(math.pi / omega) - 1.0, True)


@series(
    Sweep(
        "radius / distance from the surface", decades(0, 12), (1.0, 1e3, 1e6, 1e12), 1_000, 20_000
    ),
    unit="of the value",
    explained="the law allows for the condition, 1 / cos, so that both may lose digits alike: "
    "Mitsuba is off by 6.9e-5 at 1e6, ours by 6.3e-14; it is asked as far as float32 has points "
    "that close, 2^20",
)
def close_spheres(draw: Draw, x: float) -> Outcomes:
    """The solid angle that light samples of a sphere stand for, seen from just off it."""
    return _sphere(draw, draw.rng.uniform(1.0, 2.0, draw.cases) / x, x < 2.0**20)


# Solid angles of rectangles and triangles.
#
# Nothing is left to chance: a light sample is a function of two random numbers, and the mean of
# 1 / pdf over all of them, an integral over the unit square, is the light's solid angle whatever
# the sampler.  Gauss and Legendre's rule takes it, after u = s²(3 - 2s), which makes the roots of
# warps to triangles smooth.


CORNERS = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0))
"""Of the triangle; it shines upwards, like the rectangle [-1, 1]²."""

SQUARE = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0))

RULES = (20, 14)
"""Nodes along either number.  Of samples uniform over the area, from three half edges away, 8 nodes
are off by 9e-7, 12 by 2e-10, 16 by 9e-14 (measured): 20 by less than u."""

DOUBT = 0.01
"""What the rule may be off by, relatively, is what the two differ by; at most this, where neither
converges."""


@entry_kernel
def _of_rectangle(table: Any, area: float, p: Any, u: Any, out: Any) -> None:
    for i in range(len(p)):
        for k in range(len(u)):
            out[i, k] = rectangle.sample(table, 0, area, row(p, i), u[k, 0], u[k, 1]).pdf


@entry_kernel
def _of_triangle(table: Any, area: float, p: Any, u: Any, out: Any) -> None:
    for i in range(len(p)):
        for k in range(len(u)):
            out[i, k] = triangle.sample(table, 0, area, row(p, i), u[k, 0], u[k, 1]).pdf


def rule(n: int) -> tuple[FloatArray, FloatArray]:
    """Numbers (n², 2) in the unit square and their weights (n²,), whose sum is 1."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    s = 0.5 * (nodes + 1.0)
    u, w = s * s * (3.0 - 2.0 * s), weights * s * (1.0 - s)
    both = np.stack(np.meshgrid(u, u, indexing="ij"), axis=-1).reshape(-1, 2)
    product = np.outer(w, w).reshape(-1)
    return both, product / math.fsum(product)


def _triangle_angle(a: list[arb], b: list[arb], c: list[arb]) -> tuple[arb, float]:
    """The solid angle of a triangle seen from the origin, and the condition of its denominator."""
    lengths = [dot(v, v).sqrt() for v in (a, b, c)]
    terms = [
        lengths[0] * lengths[1] * lengths[2],
        dot(a, b) * lengths[2],
        dot(b, c) * lengths[0],
        dot(c, a) * lengths[1],
    ]
    total = sum(terms, arb(0))
    volume = abs(dot(a, cross(b, c)))
    size = float(sum((abs(t) for t in terms), arb(0)))
    # Of atan2: the larger of the two sides counts.
    return 2 * arb.atan2(volume, total), size / max(abs(float(total)), float(volume))


def _exact(corners: Any, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) solid angles of a convex polygon, and their conditions."""

    def formula(at: list[arb]) -> tuple[arb, float]:
        seen = [[arb(c) - o for c, o in zip(v, at, strict=True)] for v in corners]
        angles, conditions = zip(
            *(_triangle_angle(seen[0], *seen[k : k + 2]) for k in range(1, len(seen) - 1)),
            strict=True,
        )
        return sum(angles, arb(0)), max(conditions)

    angles, conditions = exactly(formula, p).T
    return angles, conditions


def _points(rng: np.random.Generator, n: int, x: float) -> FloatArray:
    """Above the plane, of solid angles near 1 / x: in turn at least 3 away in all directions,
    and beside the shape at a grazing angle."""
    v = unit_vectors(rng, n)
    v[:, 2] = np.abs(v[:, 2])
    far = v * np.maximum(3.0, np.sqrt(4.0 * np.maximum(v[:, 2:], 1e-3) * x))
    phi = rng.uniform(0.0, 2.0 * math.pi, n)
    r = rng.uniform(4.0, 12.0, n)
    beside = np.stack([r * np.cos(phi), r * np.sin(phi), 0.25 * r**3 / x], axis=1)
    return round32(np.where((np.arange(n) % 2 == 0)[:, None], far, beside))


def _over(rng: np.random.Generator, n: int, x: float) -> FloatArray:
    """Right above the shape, so near that it fills all but about 1 / x of the half space."""
    p = np.stack(
        [rng.uniform(-0.2, 0.2, n), rng.uniform(-0.2, 0.2, n), np.full(n, 1.0 / x)], axis=1
    )
    return round32(p)


Densities = Callable[[FloatArray, FloatArray], FloatArray]
"""(n, k) of samples for points (n, 3) and numbers (k, 2)."""


def _mean(densities: Densities, p: FloatArray, nodes: int) -> FloatArray:
    u, weights = rule(nodes)
    pdf = densities(p, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(pdf > 0.0, 1.0 / pdf, 0.0) @ weights)


def _compare(name: str, corners: Any, p: FloatArray, methods: dict[str, Densities]) -> Outcomes:
    truth, condition = _exact(corners, p)
    outcomes = {}
    for who, densities in methods.items():
        mean, coarse = (_mean(densities, p, nodes) for nodes in RULES)
        doubt = relative(coarse, mean)
        allowed = 64.0 * unit_of(who) * condition + np.minimum(doubt, DOUBT)
        shown = {"shape": name, "point": p, "solid angle": plain(truth), "found": plain(mean)}
        outcomes[who] = of_errors(relative(mean, truth), allowed, shown)
    return outcomes


def _rectangle_densities(p: FloatArray, u: FloatArray) -> FloatArray:
    out = np.empty((len(p), len(u)))
    _of_rectangle(Rectangle().tabulate(TabulationContext()), 4.0, p, u, out)
    return out


def _triangle_densities(p: FloatArray, u: FloatArray) -> FloatArray:
    out = np.empty((len(p), len(u)))
    shape = Triangle(v0=CORNERS[0], v1=CORNERS[1], v2=CORNERS[2])
    _of_triangle(shape.tabulate(TabulationContext()), 2.0, p, u, out)
    return out


def _methods(draw: Draw, ours: Densities, shape: Callable[[], Any]) -> dict[str, Densities]:
    if not draw.mitsuba:
        return {OURS: ours}
    loaded = shape()

    def mitsubas(p: FloatArray, u: FloatArray) -> FloatArray:
        return theirs(loaded, p, np.broadcast_to(u, (len(p), *u.shape)))

    return {OURS: ours, MITSUBA: mitsubas}


def _square(draw: Draw, p: FloatArray) -> Outcomes:
    methods = _methods(draw, _rectangle_densities, lambda: {"type": "rectangle"})
    return _compare("rectangle", SQUARE, p, methods)


@series(
    Sweep(
        "1 / solid angle",
        (1.0, 1e1, 1e2, 1e3, *decades(4, 20, 2)),
        (1.0, 1e3, 1e6, 1e12, 1e20),
        *(200, 2_000),
    ),
    unit="of the value",
    explained="both draw points of the area, whose densities hold no difference of numbers that "
    "are alike: Mitsuba is off by a few of its u, 2.1e-7, at the end of the range as well",
)
def flat_lights(draw: Draw, x: float) -> Outcomes:
    """The mean of 1 / pdf over the random numbers of a sample of a rectangle and of a triangle,
    three half edges away or more, or beside them at a grazing angle."""
    p = _points(draw.rng, draw.cases, x)
    methods = _methods(draw, _triangle_densities, _mitsuba_triangle)
    return together([_square(draw, p), _compare("triangle", CORNERS, p, methods)])


@series(
    Sweep("half edge / height", decades(0, 12), (1.0, 1e3, 1e12), 200, 2_000), unit="of the value"
)
def lights_that_fill_the_sky(draw: Draw, x: float) -> Outcomes:
    """The mean of 1 / pdf over the random numbers of a sample of a rectangle right above. Samples
    uniform over its area miss the part that counts: right in the mean of very many, but 400, as
    well placed as 400 can be, say another solid angle."""
    return _square(draw, _over(draw.rng, draw.cases, x))


def _mitsuba_triangle() -> Any:
    return mitsuba_mesh(np.array(CORNERS), np.array([[0, 1, 2]]))
