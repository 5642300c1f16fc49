"""Box: the cube [-1, 1]³ under an affine map."""

import math
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import Bounds, FloatArray, IntArray
from reference_rt.core.ray import Crossing, Hit, Ray, SurfacePoint, at, surface_error
from reference_rt.core.vec3 import Vec3, dot, max_abs, row, triple
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import larger, select, smaller
from reference_rt.shapes import placement
from reference_rt.shapes.placement import columns, local_point, world_surface
from reference_rt.shapes.ray_simd import make_nearer
from reference_rt.shapes.shape import (
    LightPoint,
    Shape,
    Spans,
    TabulationContext,
    Tangents,
    lift,
    no_spans,
    one_span,
    solid_angle_pdf,
)


class Box(Shape):
    """The cube [-1, 1]³ with outward normals.  A transform may give it any size and place."""

    type: Literal["box"] = "box"

    def tabulate(self, context: TabulationContext) -> "Boxes":
        m = self.map_in(context)
        edges = m[:, :3]
        face_areas = 4.0 * np.linalg.norm(np.cross(edges.T[[1, 2, 0]], edges.T[[2, 0, 1]]), axis=1)
        return Boxes(face_areas=face_areas[None], **columns(m, context))


class Boxes(NamedTuple):
    """n boxes: center, to_local and edges, the half edges x, y, z, as in `shapes.placement`; the
    areas of the faces across x, y, z (n, 3); the columns of `owners`."""

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
    one = np.ones((len(boxes.center), 3))
    return placement.bounds(boxes.center, boxes.edges, -one, one)


def areas(boxes: Boxes) -> FloatArray:
    return np.asarray(2.0 * boxes.face_areas.sum(axis=1))


class Slabs(NamedTuple):
    """The t at which a ray enters and leaves the slab between the planes -1 and 1 of each axis, and
    whether it goes in the axis's positive direction."""

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

    A ray parallel to a face meets its plane at ±inf, as IEEE says, or, within the plane, at 0 *
    inf: NaN, which `distance` ignores.
    """
    from_center = ray.o - center
    ox, oy, oz = dot(x_of, from_center), dot(y_of, from_center), dot(z_of, from_center)
    ix, iy, iz = 1.0 / dot(x_of, ray.d), 1.0 / dot(y_of, ray.d), 1.0 / dot(z_of, ray.d)
    x0, x1 = (-1.0 - ox) * ix, (1.0 - ox) * ix
    y0, y1 = (-1.0 - oy) * iy, (1.0 - oy) * iy
    z0, z1 = (-1.0 - oz) * iz, (1.0 - oz) * iz
    x_up, y_up, z_up = ix > 0.0, iy > 0.0, iz > 0.0
    return Slabs(
        select(x_up, x0, x1),
        select(x_up, x1, x0),
        select(y_up, y0, y1),
        select(y_up, y1, y0),
        select(z_up, z0, z1),
        select(z_up, z1, z0),
        x_up,
        y_up,
        z_up,
    )


@kernel
def inside(s: Slabs) -> tuple[float, float]:
    """The t at which a ray enters and leaves all three slabs; for a miss the first is larger."""
    # larger(a, NaN) is a: starting with a number, neither bound can become NaN.
    t_in = larger(larger(larger(-math.inf, s.x_in), s.y_in), s.z_in)
    t_out = smaller(smaller(smaller(math.inf, s.x_out), s.y_out), s.z_out)
    return t_in, t_out


@kernel
def distance(ray: Ray, center: Vec3, x_of: Vec3, y_of: Vec3, z_of: Vec3) -> float:
    """The smallest t > 0 at which a ray meets a box's surface, inf for a miss; for a ray from
    inside that is where it leaves."""
    t_in, t_out = inside(slabs(ray, center, x_of, y_of, z_of))
    t = select(t_in > 0.0, t_in, t_out)
    nearest: float = select((t_in <= t_out) & (t > 0.0), t, math.inf)
    return nearest


nearer = make_nearer(distance)


@kernel
def arguments(boxes: Boxes, i: int) -> tuple[Vec3, Vec3, Vec3, Vec3]:
    """What `slabs` and `distance` take after the ray."""
    m = boxes.to_local
    return row(boxes.center, i), triple(m, i, 0), triple(m, i, 1), triple(m, i, 2)


@kernel
def face_entered(s: Slabs, t: float) -> float:
    """The face through which a ray enters at t: axis, + 3 on the positive side."""
    if t == s.x_in:
        return 0.0 if s.x_up else 3.0
    if t == s.y_in:
        return 1.0 if s.y_up else 4.0
    return 2.0 if s.z_up else 5.0


@kernel
def face_left(s: Slabs, t: float) -> float:
    """The face through which a ray leaves at t."""
    if t == s.x_out:
        return 3.0 if s.x_up else 0.0
    if t == s.y_out:
        return 4.0 if s.y_up else 1.0
    return 5.0 if s.z_up else 2.0


@kernel
def found(boxes: Boxes, i: int, ray: Ray, t: float) -> Crossing:
    """The crossing of box i at t; its u is the face: axis, + 3 on the positive side."""
    s = slabs(ray, *arguments(boxes, i))
    t_in, _ = inside(s)
    return Crossing(t, face_entered(s, t) if t == t_in else face_left(s, t), 0.0)


@kernel
def spans(boxes: Boxes, i: int, ray: Ray) -> Spans:
    s = slabs(ray, *arguments(boxes, i))
    t_in, t_out = inside(s)
    if t_in <= t_out:
        return one_span(t_in, face_entered(s, t_in), t_out, face_left(s, t_out))
    return no_spans()


crossings = spans


@kernel
def intersect(boxes: Boxes, i: int, ray: Ray) -> Crossing:
    """Where the ray meets box i."""
    return found(boxes, i, ray, distance(ray, *arguments(boxes, i)))


@kernel
def on_face(local: Vec3, axis: int, sign: float) -> Vec3:
    """`local` with the coordinate `axis` set to exactly ±1."""
    if axis == 0:
        return Vec3(sign, local.y, local.z)
    if axis == 1:
        return Vec3(local.x, sign, local.z)
    return Vec3(local.x, local.y, sign)


@kernel
def face_normal(axis: int, sign: float) -> Vec3:
    """The local normal of a face."""
    return on_face(Vec3(0.0, 0.0, 0.0), axis, sign)


@kernel
def surface(boxes: Boxes, ray: Ray, hit: Hit) -> SurfacePoint:
    i = hit.row
    axis, sign = int(hit.u), -1.0
    if axis >= 3:
        axis, sign = axis - 3, 1.0
    q = on_face(local_point(boxes, i, at(ray, hit.t)), axis, sign)
    # The rounding of ±1 - o in `slabs` is within what world_error allows for: no error is added.
    n = face_normal(axis, sign)
    return world_surface(boxes, i, q, n, 0.0, boxes.material[i], boxes.light[i])


@kernel
def sample(boxes: Boxes, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    """A point uniform over the faces, as a light for `p`; u0 picks the face and is used again."""
    # Shifted by half a face: otherwise u0 = 1/2 would be an edge between two faces of a cube.
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
    # The sums above round: v may be slightly above 1.
    a, b = 2.0 * min(v, 1.0) - 1.0, 2.0 * u1 - 1.0
    local = Vec3(a, a, b) if axis == 0 else Vec3(a, b, b)
    q = on_face(local, axis, sign)
    point = world_surface(boxes, i, q, face_normal(axis, sign), 0.0, -1, -1)
    density = pdf(boxes, i, area, p, point)
    face = axis + 3.0 if sign > 0.0 else axis + 0.0
    return LightPoint(point.p, point.n, point.error, density, face, 0.0)


@kernel
def lift_of(boxes: Boxes, i: int, p: Vec3) -> float:
    """See `shape.lift`.

    Its error bound holds for every point of the box: in `world_error`, |A| |q| is at most `reach`,
    and the part along the local normal, over the length of that normal in the world, is at most the
    length of `reach`.
    """
    a, b, c = triple(boxes.edges, i, 0), triple(boxes.edges, i, 1), triple(boxes.edges, i, 2)
    center = row(boxes.center, i)
    reach = Vec3(
        abs(a.x) + abs(b.x) + abs(c.x),
        abs(a.y) + abs(b.y) + abs(c.y),
        abs(a.z) + abs(b.z) + abs(c.z),
    )
    return lift(p - center, reach, surface_error(p, center, 2.0 * max_abs(reach)))


@kernel
def pdf(boxes: Boxes, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density of `sample` per solid angle, at the point `q` of the box."""
    return solid_angle_pdf(p, q.p, q.n, area, lift_of(boxes, i, p))


@kernel
def uv(boxes: Boxes, ray: Ray, hit: Hit) -> tuple[float, float]:
    """The two other local coordinates of the face, in the order x, y, z, from 0 to 1."""
    i = hit.row
    local = local_point(boxes, i, at(ray, hit.t))
    axis = int(hit.u) % 3
    a = local.y if axis == 0 else local.x
    b = local.y if axis == 2 else local.z
    return 0.5 * (a + 1.0), 0.5 * (b + 1.0)


@kernel
def tangents(boxes: Boxes, ray: Ray, hit: Hit) -> Tangents:
    axis = int(hit.u) % 3
    a, b = 1 if axis == 0 else 0, 1 if axis == 2 else 2
    return Tangents(triple(boxes.edges, hit.row, a) * 2.0, triple(boxes.edges, hit.row, b) * 2.0)


@kernel
def face_of(boxes: Boxes, hit: Hit) -> int:
    """The axis, + 3 on the positive side."""
    return int(hit.u)
