"""Box: the cube [-1, 1]³ under an affine map."""

import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from reference_rt import transform
from reference_rt.kernel import kernel, reciprocal
from reference_rt.ray import Hit, Ray, SurfacePoint, at, surface_error
from reference_rt.shapes.shape import (
    BOX,
    Bounds,
    FloatArray,
    IntArray,
    LightPoint,
    Shape,
    outward,
    solid_angle_pdf,
)
from reference_rt.vec3 import Vec3, component, dot, max_abs, normalize, row


class Box(Shape):
    """The cube [-1, 1]³, outward normals, where its transform takes it."""

    type: Literal["box"] = "box"

    def tabulate(self, shape: int, material: int, folder: Path) -> "Boxes":
        m = transform.affine(self.transform)
        inverse = transform.invert(m)[:, :3]
        edges = m[:, :3]
        face_areas = 4.0 * np.linalg.norm(np.cross(edges.T[[1, 2, 0]], edges.T[[2, 0, 1]]), axis=1)
        return Boxes(
            center=m[:, 3].copy()[None],
            to_local=inverse.reshape(1, 9).copy(),
            edges=edges.T.reshape(1, 9).copy(),
            face_areas=face_areas[None],
            owner=np.array([shape]),
            material=np.array([material]),
            light=np.array([-1]),
            face=np.array([0]),
        )


class Boxes(NamedTuple):
    """n boxes: center (n, 3), rows of the inverse map (n, 9), half edges x, y, z (n, 9), the areas
    of the faces across x, y, z (n, 3); owner, the shape's index
    in the scene; material, light: rows of those tables; face (n,)."""

    center: FloatArray
    to_local: FloatArray
    edges: FloatArray
    face_areas: FloatArray
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


def bounds(boxes: Boxes) -> Bounds:
    """Boxes along the axes (n, 3), (n, 3) that contain the boxes, rounded outwards."""
    reach = np.abs(boxes.edges.reshape(-1, 3, 3)).sum(axis=1)
    # Three sums of three products round up to eight times, on numbers no larger than the reach.
    reach *= 1.0 + 8.0 * np.finfo(float).eps
    return outward(boxes.center - reach, boxes.center + reach)


def areas(boxes: Boxes) -> FloatArray:
    return np.asarray(2.0 * boxes.face_areas.sum(axis=1))


@kernel
def axis_row(array: FloatArray, i: int, axis: int) -> Vec3:
    """Vector `axis` of the three in row i of an (n, 9) array."""
    return Vec3(array[i, 3 * axis], array[i, 3 * axis + 1], array[i, 3 * axis + 2])


@kernel
def local_direction(boxes: Boxes, i: int, v: Vec3) -> Vec3:
    return Vec3(
        dot(axis_row(boxes.to_local, i, 0), v),
        dot(axis_row(boxes.to_local, i, 1), v),
        dot(axis_row(boxes.to_local, i, 2), v),
    )


@kernel
def intersect(boxes: Boxes, i: int, ray: Ray, closest: Hit) -> Hit:
    """The nearer of `closest` and box i by slabs (Kay & Kajiya 1986) in the box's coordinates.

    From inside the hit is where the ray leaves.  The hit's u is the face: axis, + 3 on the positive
    side.  IEEE infinities settle rays along a face, and rays *in* its plane: see `slab`.
    """
    o = local_direction(boxes, i, ray.o - row(boxes.center, i))
    d = local_direction(boxes, i, ray.d)
    inverse = Vec3(reciprocal(d.x), reciprocal(d.y), reciprocal(d.z))
    x0, x1 = (-1.0 - o.x) * inverse.x, (1.0 - o.x) * inverse.x
    y0, y1 = (-1.0 - o.y) * inverse.y, (1.0 - o.y) * inverse.y
    z0, z1 = (-1.0 - o.z) * inverse.z, (1.0 - o.z) * inverse.z
    # No branches until the end: which slab is entered last is not to be predicted (measured).
    t_near = max(max(min(x0, x1), min(y0, y1)), min(z0, z1))
    t_far = min(min(max(x0, x1), max(y0, y1)), max(z0, z1))
    t = t_near if t_near > 0.0 else t_far
    if (t_near <= t_far) & (t > 0.0) & (t < closest.t):
        return Hit(t, BOX, i, _face_at(t, x0, x1, y0, y1, z0, z1), 0.0)
    return closest


@kernel
def _face_at(
    t: float, x0: float, x1: float, y0: float, y1: float, z0: float, z1: float
) -> float:
    """Which of the six plane distances `t` is: axis, + 3 on the positive side."""
    if t == x0:
        return 0.0
    if t == x1:
        return 3.0
    if t == y0:
        return 1.0
    if t == y1:
        return 4.0
    if t == z0:
        return 2.0
    return 5.0


@kernel
def intersect_all(boxes: Boxes | None, ray: Ray, any_hit: bool, closest: Hit) -> Hit:
    """The nearest of `closest` and all boxes; with `any_hit`, the first that is found."""
    if boxes is None:
        return closest
    for i in range(len(boxes.owner)):
        closest = intersect(boxes, i, ray, closest)
    return closest


@kernel
def face_normal(boxes: Boxes, i: int, axis: int, sign: float) -> Vec3:
    """The covector of the face's own coordinate, made unit: the inverse transpose at work."""
    return normalize(axis_row(boxes.to_local, i, axis)) * sign


@kernel
def place(boxes: Boxes, i: int, local: Vec3) -> Vec3:
    return (
        row(boxes.center, i)
        + axis_row(boxes.edges, i, 0) * local.x
        + axis_row(boxes.edges, i, 1) * local.y
        + axis_row(boxes.edges, i, 2) * local.z
    )


@kernel
def on_face(local: Vec3, axis: int, sign: float) -> Vec3:
    """`local` with the coordinate `axis` set to exactly ±1."""
    if axis == 0:
        return Vec3(sign, local.y, local.z)
    if axis == 1:
        return Vec3(local.x, sign, local.z)
    return Vec3(local.x, local.y, sign)


@kernel
def error_at(boxes: Boxes, i: int, p: Vec3) -> float:
    size = (
        max_abs(axis_row(boxes.edges, i, 0))
        + max_abs(axis_row(boxes.edges, i, 1))
        + max_abs(axis_row(boxes.edges, i, 2))
    )
    return surface_error(p, row(boxes.center, i), size)


@kernel
def surface(boxes: Boxes, ray: Ray, hit: Hit) -> SurfacePoint:
    i = hit.row
    axis, sign = int(hit.u), -1.0
    if axis >= 3:
        axis, sign = axis - 3, 1.0
    local = local_direction(boxes, i, at(ray, hit.t) - row(boxes.center, i))
    p = place(boxes, i, on_face(local, axis, sign))
    n = face_normal(boxes, i, axis, sign)
    return SurfacePoint(p, n, n, error_at(boxes, i, p), boxes.material[i], boxes.light[i])


@kernel
def sample(boxes: Boxes, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    """A point uniform over the six faces, as a light for `p`; u0 picks the face and is used again."""
    v = u0 * area
    axis = 0
    while axis < 2 and v >= 2.0 * boxes.face_areas[i, axis]:
        v -= 2.0 * boxes.face_areas[i, axis]
        axis += 1
    v /= boxes.face_areas[i, axis]
    sign = -1.0
    if v >= 1.0:
        v, sign = v - 1.0, 1.0
    # The sums above round: v may end a hair above 1.
    a, b = 2.0 * min(v, 1.0) - 1.0, 2.0 * u1 - 1.0
    local = Vec3(a, a, b) if axis == 0 else Vec3(a, b, b)
    q = place(boxes, i, on_face(local, axis, sign))
    n = face_normal(boxes, i, axis, sign)
    return LightPoint(q, n, error_at(boxes, i, q), solid_angle_pdf(p, q, n, area))


@kernel
def uv(boxes: Boxes, ray: Ray, hit: Hit) -> tuple[float, float]:
    """The two other local coordinates of the face, in the order x, y, z, from 0 to 1."""
    i = hit.row
    local = local_direction(boxes, i, at(ray, hit.t) - row(boxes.center, i))
    axis = int(hit.u) % 3
    a = local.y if axis == 0 else local.x
    b = local.y if axis == 2 else local.z
    return 0.5 * (a + 1.0), 0.5 * (b + 1.0)
