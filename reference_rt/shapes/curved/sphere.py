"""Sphere: |p - c| = r."""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core import transform
from reference_rt.core.arrays import Bounds, FloatArray, IntArray
from reference_rt.core.model import Examples, Positive, Vector
from reference_rt.core.ray import Crossing, Hit, Ray, SurfacePoint, at, miss, surface_error
from reference_rt.core.vec3 import Vec3, dot, frame_from_normal, length, normalize, row, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import larger, select, smaller, square_root, with_sign
from reference_rt.sampling.warp import around, on_circle, turns
from reference_rt.shapes.curved.quadric import ellipsoid
from reference_rt.shapes.curved.quadrics import Quadrics
from reference_rt.shapes.placement import local_vector, owners, world_covector
from reference_rt.shapes.ray_simd import make_nearer
from reference_rt.shapes.rounding import along_from
from reference_rt.shapes.shape import (
    NO_LIGHT_POINT,
    LightPoint,
    Shape,
    Spans,
    TabulationContext,
    Tangents,
    any_tangents,
    no_spans,
    one_span,
    outward,
)


class Sphere(Shape):
    """A sphere; its outward normal is the front.  A transform may make it an ellipsoid."""

    EXAMPLES: ClassVar[Examples] = ({}, {"center": (0.3, -0.2, 0.7), "radius": 0.8})
    type: Literal["sphere"] = "sphere"
    center: Vector = (0.0, 0.0, 0.0)
    """The centre [x, y, z], before the transform, in scene units."""
    radius: Positive = 1.0
    """The radius, before the transform, in scene units."""

    def tabulate(self, context: TabulationContext) -> "Spheres | Quadrics":
        m = self.map_in(context)
        if m is transform.IDENTITY:
            return Spheres(
                center=np.array([self.center]),
                radius=np.array([self.radius]),
                to_local=np.eye(3).reshape(1, 9),
                **owners(context),
            )
        if not transform.is_similarity(m[:, :3]):
            return ellipsoid(context, m, self.center, self.radius)
        size = np.abs(m[:, :3]).max()  # a factor of its own: squares of extreme scales overflow
        linear = m[:, :3] / size
        factor = math.sqrt(float(np.trace(linear.T @ linear)) / 3.0)
        return Spheres(
            center=transform.apply_points(m, np.array([self.center])),
            radius=np.array([self.radius * factor * size]),
            to_local=np.asarray(np.linalg.inv(linear / factor), np.float64).reshape(1, 9),
            **owners(context),
        )


class Spheres(NamedTuple):
    """n spheres: center (n, 3), radius (n,), to_local (n, 9), the world-to-local rotation for uv;
    the columns of `owners`."""

    center: FloatArray
    radius: FloatArray
    to_local: FloatArray
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


def bounds(spheres: Spheres) -> Bounds:
    """Boxes (n, 3), (n, 3) that contain the spheres, rounded outwards."""
    r = spheres.radius[:, None]
    return outward(spheres.center - r, spheres.center + r)


def areas(spheres: Spheres) -> FloatArray:
    return 4.0 * math.pi * np.square(spheres.radius)


class _Quadratic(NamedTuple):
    """The quadratic of a line and a sphere in t: a, half of minus the linear term as b, c; and its
    discriminant divided by a."""

    a: float
    b: float
    c: float
    discriminant: float


@kernel
def _quadratic(ray: Ray, center: Vec3, r: float) -> _Quadratic:
    """In a form without cancellation for far or small spheres (Haines et al. 2019, "Ray Tracing
    Gems", ch. 7): the discriminant from the closest approach.  There the error of the closest
    approach is u D for an origin at distance D.  Here it is computed without that error
    (`along_from`), and the error of its t, along d, is subtracted again: the result does not depend
    on D.
    """
    f = ray.o - center
    a = dot(ray.d, ray.d)
    b = -dot(f, ray.d)
    per_a = 1.0 / a
    approach = along_from(ray.o, ray.d, center, b * per_a)
    past = dot(approach, ray.d)
    discriminant = r * r - dot(approach, approach) + past * past * per_a
    return _Quadratic(a, b, dot(f, f) - r * r, discriminant)


@kernel
def _roots(line: _Quadratic) -> tuple[float, float]:
    """t where the line enters the sphere, and where it leaves: the second from the first."""
    q = line.b + with_sign(square_root(line.a * larger(line.discriminant, 0.0)), line.b)
    t0, t1 = line.c / q, q / line.a
    return smaller(t0, t1), larger(t0, t1)


@kernel
def roots(ray: Ray, center: Vec3, r: float) -> tuple[bool, float, float]:
    """(whether the line meets the sphere, t where it enters, t where it leaves), t of any sign."""
    line = _quadratic(ray, center, r)
    near, far = _roots(line)
    return line.discriminant >= 0.0, near, far


@kernel
def _first(meets: bool, near: float, far: float) -> float:
    """The first of two roots above 0; inf for none."""
    t = select(near > 0.0, near, far)
    nearest: float = select(meets & (t > 0.0), t, math.inf)
    return nearest


@kernel
def distance(ray: Ray, center: Vec3, r: float) -> float:
    """The smallest t > 0 at which a ray meets a sphere, inf for a miss."""
    meets, near, far = roots(ray, center, r)
    return _first(meets, near, far)


nearer = make_nearer(distance)


@kernel
def arguments(spheres: Spheres, i: int) -> tuple[Vec3, float]:
    """What `distance` takes after the ray."""
    return row(spheres.center, i), spheres.radius[i]


@kernel
def spans(spheres: Spheres, i: int, ray: Ray) -> Spans:
    meets, near, far = roots(ray, row(spheres.center, i), spheres.radius[i])
    return one_span(near, 0.0, far, 0.0) if meets else no_spans()


crossings = spans


@kernel
def found(spheres: Spheres, i: int, ray: Ray, t: float) -> Crossing:
    """The crossing of sphere i at t; u and v are not used."""
    return Crossing(t, 0.0, 0.0)


@kernel
def intersect(spheres: Spheres, i: int, ray: Ray) -> Crossing:
    """Where the ray meets sphere i: `distance`, without the roots of a sphere that it passes by, as
    most are: 14 % of a Whitted picture of 200 spheres (measured)."""
    line = _quadratic(ray, row(spheres.center, i), spheres.radius[i])
    if not line.discriminant >= 0.0:
        return miss()
    near, far = _roots(line)
    return Crossing(_first(True, near, far), 0.0, 0.0)


@kernel
def surface(spheres: Spheres, ray: Ray, hit: Hit) -> SurfacePoint:
    """The point, projected onto the sphere, so that only the rounding of c + r n is left."""
    i = hit.row
    center = row(spheres.center, i)
    r = spheres.radius[i]
    n = normalize(at(ray, hit.t) - center)
    p = center + n * r
    error = surface_error(p, center, 2.0 * r)
    return SurfacePoint(p, n, n, error, spheres.material[i], spheres.light[i])


@kernel
def uv(spheres: Spheres, ray: Ray, hit: Hit) -> tuple[float, float]:
    """(phi / 2 pi from local +x, theta / pi from local +z), each in [0, 1]."""
    n = normalize(at(ray, hit.t) - row(spheres.center, hit.row))
    x, y, z = local_vector(spheres, hit.row, n)
    return around(y, x), 2.0 * turns(math.sqrt(x * x + y * y), z)


@kernel
def tangents(spheres: Spheres, ray: Ray, hit: Hit) -> Tangents:
    """Eastwards and southwards; any tangents at a pole."""
    i = hit.row
    n = normalize(at(ray, hit.t) - row(spheres.center, i))
    x, y, z = local_vector(spheres, i, n)
    rho = math.sqrt(x * x + y * y)
    if rho == 0.0:
        return any_tangents(n)
    # The inverse of a rotation is its transpose.
    east = world_covector(spheres, i, Vec3(-y, x, 0.0))
    south = world_covector(spheres, i, Vec3(x * z / rho, y * z / rho, -rho))
    r = spheres.radius[i]
    return Tangents(east * (2.0 * math.pi * r), south * (math.pi * r))


@kernel
def is_outside(p: Vec3, center: Vec3, r: float) -> bool:
    """Whether `p` is outside the sphere by more than its own error bound: from a point of the
    sphere itself none of it is visible, on whichever side rounding has put the point."""
    return length(center - p) - r > surface_error(p, center, 2.0 * r)


@kernel
def cone_of_sight(distance2: float, r: float) -> float:
    """1 - cos(theta_max) of the cone that a sphere subtends, without cancellation."""
    sin2 = r * r / distance2
    return sin2 / (1.0 + math.sqrt(1.0 - sin2))


@kernel
def sample(spheres: Spheres, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    """A point of the sphere visible from `p` outside, uniform in the cone that it subtends.

    pdf per solid angle: 1 / (2 pi (1 - cos theta_max)) (Shirley, Wang & Zimmerman 1996).
    """
    center = row(spheres.center, i)
    r = spheres.radius[i]
    to_center = center - p
    distance2 = dot(to_center, to_center)
    if not is_outside(p, center, r):
        return NO_LIGHT_POINT
    one_minus_cos_max = cone_of_sight(distance2, r)
    one_minus_cos = u0 * one_minus_cos_max
    cos_theta = 1.0 - one_minus_cos
    sin2 = one_minus_cos * (1.0 + cos_theta)
    sin_theta = math.sqrt(sin2)
    cos_phi, sin_phi = on_circle(u1)
    frame = frame_from_normal(to_center * (1.0 / math.sqrt(distance2)))
    wi = to_world(frame, Vec3(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta))
    # The nearer root of the quadratic; at the rim rounding may make it negative.
    half_chord2 = max(0.0, r * r - distance2 * sin2)
    along = math.sqrt(distance2) * cos_theta - math.sqrt(half_chord2)
    n = normalize(p + wi * along - center)
    q = center + n * r
    density = 0.5 / (math.pi * one_minus_cos_max)
    return LightPoint(q, n, surface_error(q, center, 2.0 * r), density, 0.0, 0.0)


@kernel
def pdf(spheres: Spheres, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density of `sample` per solid angle, for directions from `p` that meet the sphere."""
    to_center = row(spheres.center, i) - p
    distance2 = dot(to_center, to_center)
    r = spheres.radius[i]
    if not is_outside(p, row(spheres.center, i), r):
        return 0.0
    return 0.5 / (math.pi * cone_of_sight(distance2, r))
