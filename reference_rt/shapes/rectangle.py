"""Rectangle: the square [-1, 1]² in the plane z = 0, normal +z, under an affine map."""

import math
from typing import Literal, NamedTuple

import numpy as np

from reference_rt import transform
from reference_rt.kernel import kernel
from reference_rt.ray import Crossing, Hit, Ray, SurfacePoint, at, surface_error
from reference_rt.shapes.placement import owners
from reference_rt.shapes.shape import (
    Bounds,
    FloatArray,
    IntArray,
    LightPoint,
    Place,
    Shape,
    lane_vector,
    outward,
    pack,
    solid_angle_pdf,
)
from reference_rt.vec3 import Vec3, dot, max_abs, row


class Rectangle(Shape):
    """The square [-1, 1]² at z = 0 with normal +z, where its transform takes it."""

    type: Literal["rectangle"] = "rectangle"

    def tabulate(self, place: Place) -> "Rectangles":
        m = self.map_in(place)
        inverse = transform.invert(m)
        return Rectangles(
            center=m[:, 3].copy()[None],
            normal=transform.apply_normals(m, np.array([[0.0, 0.0, 1.0]])),
            x_of=inverse[0, :3].copy()[None],
            y_of=inverse[1, :3].copy()[None],
            x_edge=m[:, 0].copy()[None],
            y_edge=m[:, 1].copy()[None],
            **owners(place),
        )


class Rectangles(NamedTuple):
    """n parallelograms: center, unit normal, the covectors that give a point's local x and y, the
    half edges that these undo, all (n, 3); owner, the shape's index
    in the scene; material, light: rows of those tables; face (n,)."""

    center: FloatArray
    normal: FloatArray
    x_of: FloatArray
    y_of: FloatArray
    x_edge: FloatArray
    y_edge: FloatArray
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


def bounds(rectangles: Rectangles) -> Bounds:
    """Boxes (n, 3), (n, 3) that contain the rectangles, rounded outwards."""
    reach = np.abs(rectangles.x_edge) + np.abs(rectangles.y_edge)
    return outward(rectangles.center - reach, rectangles.center + reach)


def areas(rectangles: Rectangles) -> FloatArray:
    cross = np.cross(rectangles.x_edge, rectangles.y_edge)
    return np.asarray(4.0 * np.linalg.norm(cross, axis=1))


def pack_all(rectangles: Rectangles) -> FloatArray:
    """What `distance` takes, as packets."""
    return pack(rectangles.center, rectangles.normal, rectangles.x_of, rectangles.y_of)


@kernel
def distance(ray: Ray, center: Vec3, normal: Vec3, x_of: Vec3, y_of: Vec3) -> float:
    """The t > 0 at which a ray meets a rectangle, inf where it does not."""
    from_center = ray.o - center
    # For a parallel ray this is ±inf or NaN: both fail the comparisons.
    t = -dot(from_center, normal) / dot(ray.d, normal)
    q = from_center + ray.d * t
    if (t > 0.0) & (abs(dot(q, x_of)) <= 1.0) & (abs(dot(q, y_of)) <= 1.0):
        return t
    return math.inf


@kernel
def found(rectangles: Rectangles, i: int, ray: Ray, t: float) -> Crossing:
    """The crossing of rectangle i at t; its u, v are the local x, y in [-1, 1]."""
    q = at(ray, t) - row(rectangles.center, i)
    return Crossing(t, dot(q, row(rectangles.x_of, i)), dot(q, row(rectangles.y_of, i)))


@kernel
def intersect(rectangles: Rectangles, i: int, ray: Ray) -> Crossing:
    """Where the ray meets rectangle i."""
    t = distance(
        ray,
        row(rectangles.center, i),
        row(rectangles.normal, i),
        row(rectangles.x_of, i),
        row(rectangles.y_of, i),
    )
    return found(rectangles, i, ray, t)


@kernel
def lane_distance(
    rectangles: Rectangles, packets: FloatArray, k: int, lane: int, ray: Ray
) -> float:
    """`distance` for one lane of packet k of `pack_all`."""
    return distance(
        ray,
        lane_vector(packets, k, 0, lane),
        lane_vector(packets, k, 3, lane),
        lane_vector(packets, k, 6, lane),
        lane_vector(packets, k, 9, lane),
    )


@kernel
def place(rectangles: Rectangles, i: int, x: float, y: float) -> Vec3:
    """The point at local (x, y): in the plane by construction."""
    return row(rectangles.center, i) + row(rectangles.x_edge, i) * x + row(rectangles.y_edge, i) * y


@kernel
def error_at(rectangles: Rectangles, i: int, p: Vec3) -> float:
    size = max_abs(row(rectangles.x_edge, i)) + max_abs(row(rectangles.y_edge, i))
    return surface_error(p, row(rectangles.center, i), size)


@kernel
def surface(rectangles: Rectangles, ray: Ray, hit: Hit) -> SurfacePoint:
    i = hit.row
    p = place(rectangles, i, hit.u, hit.v)
    n = row(rectangles.normal, i)
    return SurfacePoint(
        p, n, n, error_at(rectangles, i, p), rectangles.material[i], rectangles.light[i]
    )


@kernel
def uv(rectangles: Rectangles, ray: Ray, hit: Hit) -> tuple[float, float]:
    """(x + 1) / 2 and (y + 1) / 2."""
    return 0.5 * (hit.u + 1.0), 0.5 * (hit.v + 1.0)


@kernel
def sample(
    rectangles: Rectangles, i: int, area: float, p: Vec3, u0: float, u1: float
) -> LightPoint:
    """A point uniform over the area, as a light for `p`."""
    q = place(rectangles, i, 2.0 * u0 - 1.0, 2.0 * u1 - 1.0)
    n = row(rectangles.normal, i)
    return LightPoint(q, n, error_at(rectangles, i, q), solid_angle_pdf(p, q, n, area))
