"""Solid angles of lights, as their densities say them."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from flint import arb, ctx

from comparisons.float32 import round32
from comparisons.mitsuba_backend import mitsuba
from comparisons.mitsuba_scene import for_rays
from comparisons.stability.f11_outcomes import hexed, outcome, relative, together, unit_of
from comparisons.stability.family import MITSUBA, OURS, Draw, FloatArray, Outcome, Series, decades
from reference_rt.kernel import entry_kernel
from reference_rt.shapes import rectangle, sphere, triangle
from reference_rt.shapes.rectangle import Rectangle
from reference_rt.shapes.shape import Place
from reference_rt.shapes.sphere import Sphere
from reference_rt.shapes.triangle import Triangle
from reference_rt.vec3 import row

TEXTBOOK = "sphere.cosine"

CORNERS = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0))
"""Of the triangle; it shines upwards, like the rectangle [-1, 1]²."""

SQUARE = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0))

SAMPLES = 64


@entry_kernel
def _of_sphere(table: Any, p: Any, u: Any, out: Any) -> None:
    for i in range(len(p)):
        for k in range(u.shape[1]):
            out[i, k] = sphere.sample(table, 0, 0.0, row(p, i), u[i, k, 0], u[i, k, 1]).pdf


@entry_kernel
def _of_rectangle(table: Any, area: float, p: Any, u: Any, out: Any) -> None:
    for i in range(len(p)):
        for k in range(u.shape[1]):
            out[i, k] = rectangle.sample(table, 0, area, row(p, i), u[i, k, 0], u[i, k, 1]).pdf


@entry_kernel
def _of_triangle(table: Any, area: float, p: Any, u: Any, out: Any) -> None:
    for i in range(len(p)):
        for k in range(u.shape[1]):
            out[i, k] = triangle.sample(table, 0, area, row(p, i), u[i, k, 0], u[i, k, 1]).pdf


def _table(shape: Any) -> Any:
    return shape.tabulate(Place())


def _theirs(shape: dict[str, Any] | Any, p: FloatArray, u: FloatArray) -> FloatArray:
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


def _sphere(draw: Draw, gap: FloatArray, shared: bool) -> dict[str, Outcome]:
    """The unit sphere from 1 + gap."""
    v = draw.rng.normal(size=(len(gap), 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    p = np.ascontiguousarray(v * (1.0 + gap)[:, None])
    p = round32(p) if shared else p
    exact, cosines = [], []
    with ctx.workprec(300):
        for at in p.tolist():
            d2 = sum((arb(c) * arb(c) for c in at), arb(0))
            cosine = (1 - 1 / d2).sqrt() if d2 > 1 else arb(0)
            exact.append(float(2 * arb.pi() * (1 / d2) / (1 + cosine)))
            cosines.append(float(cosine))
    truth, cosine = np.array(exact), np.array(cosines)
    out = np.empty((len(p), 1))
    u = draw.rng.uniform(0.0, 1.0, (len(p), 1, 2))
    _of_sphere(_table(Sphere()), p, u, out)
    d2 = (p * p).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        naive = 2.0 * math.pi * (1.0 - np.sqrt(1.0 - 1.0 / d2))
        found = {OURS: 1.0 / out[:, 0], TEXTBOOK: naive}
        if draw.mitsuba and shared:
            found[MITSUBA] = 1.0 / _theirs({"type": "sphere"}, p, u)[:, 0]
    outcomes = {}
    for who, value in found.items():

        def ask(i: int, value: FloatArray = value) -> Any:
            told = {"sphere": "of radius 1 at the origin", "point": hexed(p[i])}
            return {**told, "solid angle": float(truth[i]), "found": float(value[i])}

        allowed = 16.0 * unit_of(who) * (1.0 + 1.0 / np.maximum(cosine, 1e-300))
        outcomes[who] = outcome(relative(value, truth), allowed, ask)
    return outcomes


def _small(draw: Draw, x: float) -> dict[str, Outcome]:
    """Solid angles of 1 / x to 2 / x: pi / d²."""
    omega = draw.rng.uniform(1.0, 2.0, draw.cases) / x
    return _sphere(draw, np.sqrt(math.pi / omega) - 1.0, True)


def _close(draw: Draw, x: float) -> dict[str, Outcome]:
    return _sphere(draw, draw.rng.uniform(1.0, 2.0, draw.cases) / x, x < 2.0**20)


def _triangle_angle(a: Any, b: Any, c: Any) -> tuple[arb, float]:
    """The solid angle of a triangle seen from the origin, and the condition of its denominator."""

    def dot(p: Any, q: Any) -> arb:
        return sum((s * t for s, t in zip(p, q, strict=True)), arb(0))

    n = [b[k - 2] * c[k - 1] - b[k - 1] * c[k - 2] for k in range(3)]
    lengths = [dot(v, v).sqrt() for v in (a, b, c)]
    terms = [
        lengths[0] * lengths[1] * lengths[2],
        dot(a, b) * lengths[2],
        dot(b, c) * lengths[0],
        dot(c, a) * lengths[1],
    ]
    total = sum(terms, arb(0))
    volume = abs(dot(a, n))
    size = float(sum((abs(t) for t in terms), arb(0)))
    # Of atan2: the larger of the two sides counts.
    return 2 * arb.atan2(volume, total), size / max(abs(float(total)), float(volume))


def _exact(corners: Any, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) solid angles of a convex polygon, and their conditions."""
    angles, conditions = [], []
    with ctx.workprec(300):
        for at in p.tolist():
            seen = [[arb(c) - arb(o) for c, o in zip(v, at, strict=True)] for v in corners]
            parts = [
                _triangle_angle(seen[0], seen[k], seen[k + 1]) for k in range(1, len(seen) - 1)
            ]
            angles.append(float(sum((part[0] for part in parts), arb(0))))
            conditions.append(max(part[1] for part in parts))
    return np.array(angles), np.array(conditions)


def _points(rng: np.random.Generator, n: int, x: float) -> FloatArray:
    """Above the plane, of solid angles near 1 / x: in turn at least 3 away in all directions,
    and beside the shape at a grazing angle."""
    v = rng.normal(size=(n, 3))
    v[:, 2] = np.abs(v[:, 2])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
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


def _compare(
    draw: Draw, name: str, corners: Any, p: FloatArray, densities: Callable[..., Any], theirs: Any
) -> dict[str, Outcome]:
    u = draw.rng.uniform(0.0, 1.0, (len(p), SAMPLES, 2))
    found = {OURS: densities(p, u)}
    if draw.mitsuba:
        found[MITSUBA] = _theirs(theirs, p, u)
    truth, condition = _exact(corners, p)
    outcomes = {}
    for who, pdf in found.items():
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(pdf > 0.0, 1.0 / pdf, 0.0)
        mean = inverse.mean(axis=1)
        error = inverse.std(axis=1, ddof=1) / math.sqrt(SAMPLES)
        allowed = 6.0 * error / truth + 64.0 * unit_of(who) * condition
        off = relative(mean, truth) / allowed

        def ask(i: int, mean: FloatArray = mean) -> Any:
            told = {"shape": name, "point": hexed(p[i]), "solid angle": float(truth[i])}
            return {**told, "found": float(mean[i])}

        outcomes[who] = outcome(off, 1.0, ask)
    return outcomes


def _rectangle_densities(p: FloatArray, u: FloatArray) -> FloatArray:
    out = np.empty(u.shape[:2])
    _of_rectangle(_table(Rectangle()), 4.0, p, u, out)
    return out


def _triangle_densities(p: FloatArray, u: FloatArray) -> FloatArray:
    out = np.empty(u.shape[:2])
    shape = Triangle(v0=CORNERS[0], v1=CORNERS[1], v2=CORNERS[2])
    _of_triangle(_table(shape), 2.0, p, u, out)
    return out


def _square(draw: Draw, p: FloatArray) -> dict[str, Outcome]:
    return _compare(draw, "rectangle", SQUARE, p, _rectangle_densities, {"type": "rectangle"})


def _flat(draw: Draw, x: float) -> dict[str, Outcome]:
    p = _points(draw.rng, draw.cases, x)
    mesh = _mitsuba_triangle(draw)
    triangles = _compare(draw, "triangle", CORNERS, p, _triangle_densities, mesh)
    return together([_square(draw, p), triangles])


def _sky(draw: Draw, x: float) -> dict[str, Outcome]:
    return _square(draw, _over(draw.rng, draw.cases, x))


def _mitsuba_triangle(draw: Draw) -> Any:
    if not draw.mitsuba:
        return None
    mi = mitsuba()
    mesh = mi.Mesh("triangle", 3, 1)
    values = mi.traverse(mesh)
    values["vertex_positions"] = np.array(CORNERS, np.float32).ravel()
    values["faces"] = np.array([0, 1, 2], np.uint32)
    values.update()
    return mesh


SMALL_SPHERE = Series(
    "small spheres",
    "1 / solid angle",
    "The solid angle that light samples of a sphere stand for, seen from afar.",
    decades(0, 12),
    (1.0, 1e6, 1e12),
    {"quick": 1_000, "full": 20_000},
    _small,
    unit="of the value",
)
CLOSE_SPHERE = Series(
    "close spheres",
    "radius / distance from the surface",
    "The solid angle that light samples of a sphere stand for, seen from just off it.",
    decades(0, 12),
    (1.0, 1e3, 1e6, 1e12),
    {"quick": 1_000, "full": 20_000},
    _close,
    unit="of the value",
    explained="the law allows for the condition, 1 / cos, so that both may lose digits alike: "
    "Mitsuba is off by 6.9e-5 at 1e6, ours by 6.3e-14; it is asked as far as float32 has points "
    "that close, 2^20",
)
FLAT = Series(
    "flat lights",
    "1 / solid angle",
    "The mean of 1 / pdf of 64 samples of a rectangle and of a triangle, three half edges away or "
    "more, or beside them at a grazing angle.",
    (1.0, 1e1, 1e2, 1e3, 1e4, 1e6, 1e8, 1e10, 1e12, 1e14, 1e16, 1e18, 1e20),
    (1.0, 1e3, 1e6, 1e12, 1e20),
    {"quick": 200, "full": 2_000},
    _flat,
    unit="of what is allowed",
    explained="both draw points of the area, whose densities hold no difference of numbers that "
    "are alike: Mitsuba is off by 0.74 of what is allowed at most, of 6 standard errors",
)
SKY = Series(
    "lights that fill the sky",
    "half edge / height",
    "The mean of 1 / pdf of 64 samples of a rectangle right above.  Uniform over the area they "
    "miss the part that counts: right in the mean of very many, but 64 do not know how wrong they "
    "are.",
    decades(0, 12),
    (1.0, 1e3, 1e12),
    {"quick": 200, "full": 2_000},
    _sky,
    unit="of what is allowed",
)
