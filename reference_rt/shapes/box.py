"""Box: the cube [-1, 1]³ under an affine map."""

import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from reference_rt import transform
from reference_rt.kernel import kernel
from reference_rt.ray import Hit, Ray, SurfacePoint, at, surface_error
from reference_rt.shapes.shape import (
    BOX,
    Bounds,
    FloatArray,
    IntArray,
    LightPoint,
    Shape,
    lane_vector,
    outward,
    pack,
    solid_angle_pdf,
)
from reference_rt.vec3 import Vec3, dot, max_abs, normalize, row, triple


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
def local_direction(boxes: Boxes, i: int, v: Vec3) -> Vec3:
    return Vec3(
        dot(triple(boxes.to_local, i, 0), v),
        dot(triple(boxes.to_local, i, 1), v),
        dot(triple(boxes.to_local, i, 2), v),
    )


def pack_all(boxes: Boxes) -> FloatArray:
    """What `distance` takes, as packets."""
    return pack(boxes.center, boxes.to_local)


class Slabs(NamedTuple):
    """Where a ray enters and leaves the space between the planes -1 and 1 of each axis (t), and
    whether it runs in the axis's positive direction."""

    x_in: float
    x_out: float
    y_in: float
    y_out: float
    z_in: float
    z_out: float
    x_up: bool
    y_up: bool
    z_up: bool


@kernel
def slabs(ray: Ray, center: Vec3, x_of: Vec3, y_of: Vec3, z_of: Vec3) -> Slabs:
    """In the box's coordinates, by reciprocals (Kay & Kajiya 1986).

    A ray along a face meets its plane at ±inf, as IEEE says, or, running in the plane, at 0 * inf:
    NaN, which `distance` passes over.
    """
    from_center = ray.o - center
    ox, oy, oz = dot(x_of, from_center), dot(y_of, from_center), dot(z_of, from_center)
    ix, iy, iz = 1.0 / dot(x_of, ray.d), 1.0 / dot(y_of, ray.d), 1.0 / dot(z_of, ray.d)
    x0, x1 = (-1.0 - ox) * ix, (1.0 - ox) * ix
    y0, y1 = (-1.0 - oy) * iy, (1.0 - oy) * iy
    z0, z1 = (-1.0 - oz) * iz, (1.0 - oz) * iz
    x_up, y_up, z_up = ix > 0.0, iy > 0.0, iz > 0.0
    return Slabs(
        x0 if x_up else x1,
        x1 if x_up else x0,
        y0 if y_up else y1,
        y1 if y_up else y0,
        z0 if z_up else z1,
        z1 if z_up else z0,
        x_up,
        y_up,
        z_up,
    )


@kernel
def distance(ray: Ray, center: Vec3, x_of: Vec3, y_of: Vec3, z_of: Vec3) -> float:
    """The smallest t > 0 at which a ray meets a box's surface, inf where it does not: from inside,
    where it leaves."""
    s = slabs(ray, center, x_of, y_of, z_of)
    # max(a, NaN) is a: begun with a number, neither bound can become NaN.
    t_in = max(max(max(-math.inf, s.x_in), s.y_in), s.z_in)
    t_out = min(min(min(math.inf, s.x_out), s.y_out), s.z_out)
    t = t_in if t_in > 0.0 else t_out
    return t if (t_in <= t_out) & (t > 0.0) else math.inf


@kernel
def found(boxes: Boxes, i: int, ray: Ray, t: float) -> Hit:
    """The hit of box i at t; its u is the face: axis, + 3 on the positive side."""
    s = slabs(
        ray,
        row(boxes.center, i),
        triple(boxes.to_local, i, 0),
        triple(boxes.to_local, i, 1),
        triple(boxes.to_local, i, 2),
    )
    if t == s.x_in:
        face = 0 if s.x_up else 3
    elif t == s.y_in:
        face = 1 if s.y_up else 4
    elif t == s.z_in:
        face = 2 if s.z_up else 5
    elif t == s.x_out:
        face = 3 if s.x_up else 0
    elif t == s.y_out:
        face = 4 if s.y_up else 1
    else:
        face = 5 if s.z_up else 2
    return Hit(t, BOX, i, float(face), 0.0)


@kernel
def intersect(boxes: Boxes, i: int, ray: Ray, closest: Hit) -> Hit:
    """The nearer of `closest` and box i."""
    t = distance(
        ray,
        row(boxes.center, i),
        triple(boxes.to_local, i, 0),
        triple(boxes.to_local, i, 1),
        triple(boxes.to_local, i, 2),
    )
    return found(boxes, i, ray, t) if t < closest.t else closest


@kernel
def lane_distance(boxes: Boxes, packets: FloatArray, k: int, lane: int, ray: Ray) -> float:
    """`distance` for one lane of packet k of `pack_all`."""
    return distance(
        ray,
        lane_vector(packets, k, 0, lane),
        lane_vector(packets, k, 3, lane),
        lane_vector(packets, k, 6, lane),
        lane_vector(packets, k, 9, lane),
    )


@kernel
def face_normal(boxes: Boxes, i: int, axis: int, sign: float) -> Vec3:
    """The covector of the face's own coordinate, made unit: the inverse transpose at work."""
    return normalize(triple(boxes.to_local, i, axis)) * sign


@kernel
def place(boxes: Boxes, i: int, local: Vec3) -> Vec3:
    return (
        row(boxes.center, i)
        + triple(boxes.edges, i, 0) * local.x
        + triple(boxes.edges, i, 1) * local.y
        + triple(boxes.edges, i, 2) * local.z
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
        max_abs(triple(boxes.edges, i, 0))
        + max_abs(triple(boxes.edges, i, 1))
        + max_abs(triple(boxes.edges, i, 2))
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
    """A point uniform over the faces, as a light for `p`; u0 picks the face and is used again."""
    # Half a face's shift: the middle, u0 = 1/2, would else be where two faces of a cube meet.
    v = u0 * area - 0.5 * boxes.face_areas[i, 0]
    if v < 0.0:
        v += area
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
