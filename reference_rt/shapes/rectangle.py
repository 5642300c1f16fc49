"""Rectangle: the square [-1, 1]² in the plane z = 0, normal +z, under an affine map."""

from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from reference_rt import transform
from reference_rt.kernel import kernel
from reference_rt.ray import Hit, Ray, SurfacePoint, surface_error
from reference_rt.shapes.shape import (
    RECTANGLE,
    Bounds,
    FloatArray,
    IntArray,
    LightPoint,
    Shape,
    outward,
    solid_angle_pdf,
)
from reference_rt.vec3 import Vec3, dot, max_abs, row


class Rectangle(Shape):
    """The square [-1, 1]² at z = 0 with normal +z, where its transform takes it."""

    type: Literal["rectangle"] = "rectangle"

    def tabulate(self, shape: int, material: int, folder: Path) -> "Rectangles":
        m = transform.affine(self.transform)
        inverse = transform.invert(m)
        return Rectangles(
            center=m[:, 3].copy()[None],
            normal=transform.apply_normals(m, np.array([[0.0, 0.0, 1.0]])),
            x_of=inverse[0, :3].copy()[None],
            y_of=inverse[1, :3].copy()[None],
            x_edge=m[:, 0].copy()[None],
            y_edge=m[:, 1].copy()[None],
            owner=np.array([shape]),
            material=np.array([material]),
            light=np.array([-1]),
            face=np.array([0]),
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


@kernel
def intersect(rectangles: Rectangles, i: int, ray: Ray, closest: Hit) -> Hit:
    """The nearer of `closest` and rectangle i; the hit's u, v are the local x, y in [-1, 1]."""
    n = row(rectangles.normal, i)
    from_center = ray.o - row(rectangles.center, i)
    # For a parallel ray this is ±inf or NaN: both fail the comparisons.
    t = -dot(from_center, n) / dot(ray.d, n)
    q = from_center + ray.d * t
    x = dot(q, row(rectangles.x_of, i))
    y = dot(q, row(rectangles.y_of, i))
    # One branch for all conditions: which of them fails is not to be predicted (measured).
    if (t > 0.0) & (t < closest.t) & (abs(x) <= 1.0) & (abs(y) <= 1.0):
        return Hit(t, RECTANGLE, i, x, y)
    return closest


@kernel
def intersect_all(rectangles: Rectangles | None, ray: Ray, any_hit: bool, closest: Hit) -> Hit:
    """The nearest of `closest` and all rectangles; with `any_hit`, the first that is found."""
    if rectangles is None:
        return closest
    for i in range(len(rectangles.owner)):
        closest = intersect(rectangles, i, ray, closest)
    return closest


@kernel
def place(rectangles: Rectangles, i: int, x: float, y: float) -> Vec3:
    """The point at local (x, y): in the plane by construction."""
    return (
        row(rectangles.center, i)
        + row(rectangles.x_edge, i) * x
        + row(rectangles.y_edge, i) * y
    )


@kernel
def error_at(rectangles: Rectangles, i: int, p: Vec3) -> float:
    size = max_abs(row(rectangles.x_edge, i)) + max_abs(row(rectangles.y_edge, i))
    return surface_error(p, row(rectangles.center, i), size)


@kernel
def surface(rectangles: Rectangles, hit: Hit) -> SurfacePoint:
    i = hit.row
    p = place(rectangles, i, hit.u, hit.v)
    n = row(rectangles.normal, i)
    return SurfacePoint(
        p, n, n, error_at(rectangles, i, p), rectangles.material[i], rectangles.light[i]
    )


@kernel
def uv(hit: Hit) -> tuple[float, float]:
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
