"""Disk: the unit disk in the plane z = 0, normal +z, under an affine map: any ellipse."""

import math
from typing import Literal

import numpy as np

from reference_rt.core.arrays import Bounds, FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF, Crossing, Hit, Ray, SurfacePoint, miss
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import select
from reference_rt.sampling.warp import around, concentric_disk
from reference_rt.shapes.flat import base
from reference_rt.shapes.ray_simd import make_nearer
from reference_rt.shapes.shape import (
    LightPoint,
    Shape,
    TabulationContext,
    Tangents,
    any_tangents,
    outward,
    solid_angle_pdf,
)


class Disk(Shape):
    """The unit disk at z = 0 with normal +z.  A transform may give it any size and place."""

    type: Literal["disk"] = "disk"

    def tabulate(self, context: TabulationContext) -> "Disks":
        disks = Disks(**base.facing_z(self.map_in(context), context))
        base.check_area("disk", areas(disks)[0])
        return disks


class Disks(base.Flats):
    """n ellipses, with x_edge and y_edge as conjugate radii."""


def bounds(disks: Disks) -> Bounds:
    """Boxes (n, 3), (n, 3) that contain the disks, rounded outwards.

    cos(phi) a + sin(phi) b reaches sqrt(a² + b²) along each axis.
    """
    reach = np.hypot(disks.x_edge, disks.y_edge) * (1.0 + 8.0 * UNIT_ROUNDOFF)
    return outward(disks.center - reach, disks.center + reach)


def areas(disks: Disks) -> FloatArray:
    cross = np.cross(disks.x_edge, disks.y_edge)
    return np.asarray(math.pi * np.linalg.norm(cross, axis=1))


@kernel
def distance(ray: Ray, center: Vec3, normal: Vec3, x_of: Vec3, y_of: Vec3) -> float:
    """The t > 0 at which a ray meets a disk, inf for a miss."""
    t, x, y = base.met(ray, center, normal, x_of, y_of)
    nearest: float = select((t > 0.0) & (x * x + y * y <= 1.0), t, math.inf)
    return nearest


nearer = make_nearer(distance)
arguments, found = base.arguments, base.found


@kernel
def intersect(disks: Disks, i: int, ray: Ray) -> Crossing:
    """Where the ray meets disk i; u, v are the local x, y."""
    found = base.meet(disks, i, ray)
    if found.u * found.u + found.v * found.v <= 1.0:
        return found
    return miss()


surface, unit_normals = base.surface, base.unit_normals


@kernel
def uv(disks: Disks, ray: Ray, hit: Hit) -> tuple[float, float]:
    """(r, phi / 2 pi) of the local x, y; each in [0, 1]."""
    return math.sqrt(hit.u * hit.u + hit.v * hit.v), around(hit.v, hit.u)


@kernel
def tangents(disks: Disks, ray: Ray, hit: Hit) -> Tangents:
    """Those of polar coordinates; any in the middle."""
    i, x, y = hit.row, hit.u, hit.v
    r = math.sqrt(x * x + y * y)
    if r == 0.0:
        return any_tangents(row(disks.normal, i))
    a, b = row(disks.x_edge, i), row(disks.y_edge, i)
    return Tangents(a * (x / r) + b * (y / r), (b * x - a * y) * (2.0 * math.pi))


@kernel
def sample(disks: Disks, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    """A point uniform over the area, as a light for `p`."""
    x, y = concentric_disk(u0, u1)
    q = base.surface_at(disks, i, x, y)
    return LightPoint(q.p, q.n, q.error, pdf(disks, i, area, p, q), x, y)


@kernel
def pdf(disks: Disks, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density of `sample` per solid angle, at the point `q` of the disk."""
    return solid_angle_pdf(p, q.p, q.n, area, base.lift_of(disks, i, p))
