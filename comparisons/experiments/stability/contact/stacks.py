"""Stacks of surfaces that are close to each other, and the order in which rays meet them."""

import math
from typing import NamedTuple

import numpy as np

import reference_rt as rt
from comparisons import translator
from comparisons.experiments.stability.harness.steps import matrix, turning
from comparisons.geometry import frame
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.mitsuba.backend import scalar
from reference_rt.accel.geometry import Geometry, closest_hit, owner, surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray, ray_from
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.kept_links import link_to_geometry

COUNT = 8
"""Surfaces in a stack."""

FAR = 1000.0
"""Scales between the origin and the scenes that are far away."""

STACKS = 4
"""Drawn at each sweep point."""

THEIRS = 40
"""Rays of a stack that Mitsuba traces, in its scalar variant."""


@entry_kernel
def _follow(geometry: Geometry, o: FloatArray, d: FloatArray, out: IntArray) -> None:
    """Into out (n, steps): the shapes that a ray meets, one after another; -1 after the last."""
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        for k in range(out.shape[1]):
            hit = closest_hit(geometry, ray)
            if hit.kind < 0:
                break
            out[i, k] = owner(geometry, hit).shape
            ray = ray_from(surface(geometry, ray, hit), ray.d)


class Stack(NamedTuple):
    """A scene, rays (n, 3) and the shapes that each meets, in order (n, steps)."""

    scene: rt.Scene
    o: FloatArray
    d: FloatArray
    expected: IntArray


def follow(scene: rt.Scene, o: FloatArray, d: FloatArray, steps: int) -> IntArray:
    """The shapes that rays meet on their way straight through, -1 after the last."""
    out = np.full((len(o), steps), -1)
    found = link_to_geometry(rt.build_tables(scene), "closest_hit", "surface", "owner")
    _follow(found.tables, o, d, out)
    return out


def follow_in_mitsuba(scene: rt.Scene, o: FloatArray, d: FloatArray, steps: int) -> IntArray:
    """The same in Mitsuba, by `si.spawn_ray`."""
    out = np.full((len(o), steps), -1)
    with scalar() as mi:
        counterpart = translator.load(scene, frame.OURS)
        for i in range(len(o)):
            ray = mi.Ray3f(mi.Point3f(o[i].tolist()), mi.Vector3f(d[i].tolist()))
            for k in range(steps):
                si = counterpart.mi_scene.ray_intersect(ray)
                if not si.is_valid():
                    break
                out[i, k] = counterpart.mi_shapes[si.shape.id()].shape
                ray = si.spawn_ray(mi.Vector3f(d[i].tolist()))
    return out


def rays_down(
    rng: np.random.Generator, n: int, steepest: float = 0.4
) -> tuple[FloatArray, FloatArray]:
    """(o, d) from above through the middle of the square [-1, 1]², at up to this tangent."""
    middle = np.column_stack([rng.uniform(-0.2, 0.2, (n, 2)), np.zeros(n)])
    d = np.column_stack([rng.uniform(-steepest, steepest, (n, 2)), -np.ones(n)])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return middle - 1.5 * d, d


def plates(rng: np.random.Generator, n: int, gap: float, distance: float = 0.0) -> Stack:
    """Parallel squares, tilted."""
    axes, center = turning(rng), turning(rng)[0] * distance
    squares = tuple(
        rt.Rectangle(transform=matrix(axes, center - axes[:, 2] * (k * gap))) for k in range(COUNT)
    )
    o, d = rays_down(rng, n, 0.3)
    o, d = o @ axes.T + center, d @ axes.T
    return Stack(rt.Scene(shapes=squares), o, d, np.tile(np.arange(COUNT), (n, 1)))


def shells(rng: np.random.Generator, n: int, gap: float, distance: float = 0.0) -> Stack:
    """Spheres in spheres; rays pass near enough to the middle to meet all, twice."""
    center = turning(rng)[0] * distance
    balls = tuple(
        rt.Sphere(center=tuple(center.tolist()), radius=1.0 - k * gap) for k in range(COUNT)
    )
    o, d = rays_down(rng, n)
    numbers = np.arange(COUNT)
    expected = np.tile(np.concatenate([numbers, numbers[::-1]]), (n, 1))
    return Stack(rt.Scene(shapes=balls), o + center, d, expected)


def slots(rng: np.random.Generator, n: int, gap: float, distance: float = 0.0) -> Stack:
    """A cube cut in two by a slot, and a square in the middle of that: in, out, the square, in,
    out."""
    axes, center = turning(rng), turning(rng)[0] * distance
    cut = rt.Box(transform=matrix(np.diag([4.0, 4.0, gap]), np.zeros(3)))
    cube = rt.Difference(of=(rt.Box(), cut), transform=matrix(axes, center))
    square = rt.Rectangle(transform=matrix(axes, center))
    o, d = rays_down(rng, n)
    o, d = (o - 1.5 * d) @ axes.T + center, d @ axes.T
    expected = np.tile([0, 0, 1, 0, 0], (n, 1))
    return Stack(rt.Scene(shapes=(cube, square)), o, d, expected)


def differing(expected: IntArray, found: IntArray) -> BoolArray:
    """Which rows (n,) are not the same."""
    return np.asarray((expected != found).any(axis=1))
