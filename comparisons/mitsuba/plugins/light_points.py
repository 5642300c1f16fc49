"""The one point that represents each area light in Whitted's ray tracing.

The choice of the points is a convention, the same as in `reference_rt`: u0 = u1 = 1/2 in each
shape's own sampling.  Size, position and orientation are read from Mitsuba's own shapes, in
float64.
"""

import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray

_SMALLEST = float(np.finfo(np.float32).tiny)


class FixedPoint(NamedTuple):
    """A primitive that is represented by its point p, with unit normal n and an area: (3,), (3,),
    1; shape is Mitsuba's object;  of_mesh: whether it is one of a mesh's triangles.  The emitter
    determines which side shines."""

    p: Any
    n: Any
    area: Any
    shape: Any
    of_mesh: bool = False

    def seen_from(self, mi: Any, dr: Any, p: Any) -> tuple[Any, Any]:
        """The point, and the solid angle that it represents: area cos / distance²."""
        w = p - self.p
        distance2 = dr.squared_norm(w)
        # From the point itself the solid angle is 0: 0 over the smallest float.
        distance3 = dr.maximum(distance2 * dr.sqrt(distance2), _SMALLEST)
        return self.p, self.area * dr.abs(dr.dot(w, self.n)) / distance3


class SphereLight(NamedTuple):
    """A sphere, whose point depends on where it is seen from."""

    center: Any
    radius: Any
    shape: Any
    of_mesh: bool = False

    def seen_from(self, mi: Any, dr: Any, p: Any) -> tuple[Any, Any]:
        """The point at the mean cosine of the subtended cone, and the cone's solid angle.

        1 - cos = (1 - cos theta_max) / 2 and phi = pi, in the basis of Duff et al. (2017), which
        Mitsuba uses too.  0 from inside and from the surface, where rounding would decide: points
        closer than Mitsuba's ray epsilon count as on the surface.
        """
        to_center = self.center - p
        distance2 = dr.squared_norm(to_center)
        distance = dr.sqrt(distance2)
        r2 = self.radius * self.radius
        outside = distance - self.radius > (1.0 + dr.max(dr.abs(p))) * mi.math.RayEpsilon
        sin2_max = dr.select(outside, r2 / distance2, 0.0)
        one_minus_cos_max = sin2_max / (1.0 + dr.sqrt(1.0 - sin2_max))
        one_minus_cos = 0.5 * one_minus_cos_max
        cos = 1.0 - one_minus_cos
        sin2 = one_minus_cos * (1.0 + cos)
        frame = mi.Frame3f(mi.Normal3f(to_center / distance))
        d = frame.to_world(mi.Vector3f(-dr.sqrt(sin2), 0.0, cos))
        along = distance * cos - dr.sqrt(dr.maximum(0.0, r2 - distance2 * sin2))
        solid_angle = dr.select(outside, 2.0 * math.pi * one_minus_cos_max, 0.0)
        return p + d * along, solid_angle


class BoxPoint(NamedTuple):
    """The point of a box, on one of its faces.  From behind that face its solid angle is 0: a ray
    towards it would hit another face, near an edge within the tolerance of the right distance."""

    face: FixedPoint
    of_mesh: bool = False

    @property
    def shape(self) -> Any:
        return self.face.shape

    def seen_from(self, mi: Any, dr: Any, p: Any) -> tuple[Any, Any]:
        """As `FixedPoint.seen_from`, 0 from behind the face."""
        point, solid_angle = self.face.seen_from(mi, dr, p)
        return point, dr.select(dr.dot(p - self.face.p, self.face.n) > 0.0, solid_angle, 0.0)


LightPoint = FixedPoint | BoxPoint | SphereLight


def light_points(
    mi: Any, scene: Any, unlit: Collection[str] = (), boxes: Collection[str] = ()
) -> list[LightPoint]:
    """The points of all area lights of a scene, except shapes whose id is in `unlit`;  boxes: the
    ids of boxes, which may be meshes: see `translate.shapes.native.box_of_triangles`."""
    found: list[LightPoint] = []
    for emitter in scene.emitters():
        shape = emitter.get_shape()
        if shape is not None and shape.id() not in unlit:
            found += _points_of(mi, shape, shape.id() in boxes)
    return found


_FLAT = {"Rectangle": 4.0, "Disk": math.pi}
"""Untransformed areas of the plugins whose point is their centre."""


def _points_of(mi: Any, shape: Any, is_box: bool) -> list[LightPoint]:
    kind = shape.class_name()
    if kind == "Sphere":
        m = _to_world(mi, shape)
        return [
            SphereLight(
                mi.Point3f(m[:3, 3].tolist()), mi.Float(float(np.linalg.norm(m[:3, 0]))), shape
            )
        ]
    if kind in _FLAT:
        m = _to_world(mi, shape)
        return [_fixed(mi, shape, m[:3, 3], _FLAT[kind] * np.cross(m[:3, 0], m[:3, 1]))]
    values = mi.traverse(shape)
    vertices = np.array(values["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    if kind == "Cube" or is_box:
        return [_box_point(mi, shape, vertices, *(_CUBE if kind == "Cube" else _MESH))]
    corners = vertices[np.array(values["faces"]).reshape(-1, 3)]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Turk's square root warp: barycentrics sqrt(1/2) / 2 of the second and the third corner.
    b = 0.5 * math.sqrt(0.5)
    points = corners[:, 0] * (1.0 - 2.0 * b) + (corners[:, 1] + corners[:, 2]) * b
    sized = np.flatnonzero(np.linalg.norm(areas, axis=1) > 0.0).tolist()
    return [_fixed(mi, shape, points[k], areas[k])._replace(of_mesh=True) for k in sized]


def _to_world(mi: Any, shape: Any) -> FloatArray:
    matrix = mi.traverse(shape)["to_world"].matrix
    return np.array(matrix, dtype=np.float64).reshape(4, 4)


def _fixed(mi: Any, shape: Any, p: FloatArray, area: FloatArray) -> FixedPoint:
    """`area` (3,): the normal, as long as the area."""
    size = float(np.linalg.norm(area))
    return FixedPoint(
        mi.Point3f(p.tolist()), mi.Vector3f((area / size).tolist()), mi.Float(size), shape
    )


def _box_point(
    mi: Any, shape: Any, vertices: FloatArray, front: list[int], back: list[int]
) -> "BoxPoint":
    """The point at half of the cumulative area of the faces -x +x -y +y -z +z, starting half of the
    first face before the list."""
    center = vertices.mean(axis=0)
    middle = vertices.reshape(6, 4, 3).mean(axis=1)
    edges = 0.5 * (middle[front] - middle[back])
    normals = np.cross(edges[[1, 2, 0]], edges[[2, 0, 1]])
    normals *= np.sign(np.linalg.det(edges))  # outwards, also where a map mirrors
    face_areas = 4.0 * np.linalg.norm(normals, axis=1)
    rest = float(face_areas.sum()) - 0.5 * float(face_areas[0])
    axis = 0
    while axis < 2 and rest >= 2.0 * face_areas[axis]:
        rest -= 2.0 * float(face_areas[axis])
        axis += 1
    rest /= float(face_areas[axis])
    sign = -1.0
    if rest >= 1.0:
        rest, sign = rest - 1.0, 1.0
    first = edges[1 if axis == 0 else 0]
    p = center + edges[axis] * sign + first * (2.0 * min(rest, 1.0) - 1.0)
    n = normals[axis] / np.linalg.norm(normals[axis])
    return BoxPoint(_fixed(mi, shape, p, n * sign * 2.0 * float(face_areas.sum())))


_CUBE, _MESH = ([2, 1, 3], [4, 0, 5]), ([3, 4, 5], [0, 1, 2])
"""The faces +x +y +z and -x -y -z among the groups of four vertices: of Mitsuba's cubes
(src/shapes/cube.cpp), and of our meshes."""
