"""Rays meet a shape, leave it, and are traced again: ours in compiled loops, and Mitsuba's."""

import math
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.in_mitsuba import loaded
from comparisons.experiments.stability.harness.shadows import ray_leaving
from comparisons.experiments.stability.leaving.shapes import WHOLE, Placed, Rays, scene_of
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.mitsuba.backend import mitsuba
from reference_rt import shapes as any_shape
from reference_rt.accel.geometry import Geometry, closest_hit, surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray, SurfacePoint
from reference_rt.core.vec3 import Vec3, dot, frame_from_normal, row, to_world
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.jit.links import Linker
from reference_rt.rendering.kept_links import Linked, linked
from reference_rt.rendering.linking import geometry_of, linked_shapes
from reference_rt.shapes import Shapes
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.tables import TABLES, by_code


class Ways(NamedTuple):
    """Directions that rays leave to: local (n, 3), unit, +z along the outward normal."""

    local: FloatArray

    @property
    def outer(self) -> Any:
        return self.local[:, 2] > 0.0


class Departures(NamedTuple):
    """t (n,): where the first rays meet the shape, inf for a miss;  p, n, start, w (n, 3): the
    point, its normal, and the ray that leaves;  again (n,): where that meets the shape;  cosine
    (n,): of w to the normal there."""

    t: FloatArray
    p: FloatArray
    n: FloatArray
    start: FloatArray
    w: FloatArray
    again: FloatArray
    cosine: FloatArray

    @classmethod
    def of(cls, out: FloatArray) -> "Departures":
        """Of the columns that the kernels write."""
        return cls(
            out[:, 0], out[:, 1:4], out[:, 4:7], out[:, 7:10], out[:, 10:13], out[:, 13], out[:, 14]
        )


COLUMNS = 15


@kernel
def _write(
    out: FloatArray, i: int, t: float, point: SurfacePoint, leaving: Ray, again: float, n: Vec3
) -> None:
    out[i, 0] = t
    out[i, 1], out[i, 2], out[i, 3] = point.p
    out[i, 4], out[i, 5], out[i, 6] = point.n
    out[i, 7], out[i, 8], out[i, 9] = leaving.o
    out[i, 10], out[i, 11], out[i, 12] = leaving.d
    out[i, 13], out[i, 14] = again, dot(leaving.d, n)


@kernel
def _meet(geometry: Geometry, shapes: Shapes, kind: int, i: int, ray: Ray) -> Hit:
    """One row of a table alone, of kind -1: the whole scene."""
    if kind < 0:
        return closest_hit(geometry, ray)
    t, u, v = any_shape.intersect(shapes, kind, i, ray, shear_of(ray))
    return Hit(t, kind if t < math.inf else -1, i, u, v, -1)


@entry_kernel
def _depart(
    geometry: Geometry,
    shapes: Shapes,
    kind: int,
    rows: IntArray,
    o: FloatArray,
    d: FloatArray,
    ways: FloatArray,
    epsilon: float,
    out: FloatArray,
) -> None:
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        hit = _meet(geometry, shapes, kind, rows[i], ray)
        out[i, 0] = math.inf
        out[i, 13] = math.inf
        if hit.kind < 0:
            continue
        point = surface(geometry, ray, hit)
        w = to_world(frame_from_normal(point.n), row(ways, i))
        leaving = ray_leaving(ray, hit.t, point, w, epsilon)
        met = _meet(geometry, shapes, kind, rows[i], leaving)
        n = Vec3(0.0, 0.0, 0.0)
        again = math.inf
        if met.kind >= 0:
            n, again = surface(geometry, leaving, met).n, met.t
        _write(out, i, hit.t, point, leaving, again, n)


COMPANY = (
    rt.Sphere(),
    rt.Rectangle(),
    rt.Disk(),
    rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(0, 1, 0)),
    rt.Polygon(rings=(((0, 0, 0), (1, 0, 0), (0, 1, 0)),)),
    rt.Plane(),
    rt.Box(),
    rt.Cylinder(),
    rt.Torus(),
)
"""One of each table, so that one kernel serves them all."""


class Subject(NamedTuple):
    """A shape that rays leave: a row of a table of a geometry, or with kind -1 the whole scene.

    linked: the geometry and its shapes, as kernels that serve all scenes take them.
    """

    geometry: Geometry
    linked: Linked
    field: str
    kind: int
    row: int

    @property
    def table(self) -> Any:
        return getattr(self.geometry.shapes, self.field)


_INTERSECT = frozenset((by_code.operations["intersect"],))


def _geometry(scene: rt.Scene) -> tuple[Geometry, Linked]:
    tables = rt.build_tables(scene)
    geometry = tables.geometry

    def link(linker: Linker) -> tuple[Any, Any]:
        shapes = linked_shapes(linker, geometry.shapes, _INTERSECT)
        return geometry_of(linker, geometry, ("closest_hit", "surface")), shapes

    return geometry, linked(tables, "leaving", link)


def subjects(kind: str, placed: list[Placed]) -> list[Subject]:
    """Shapes of one kind."""
    if kind in WHOLE:
        return [Subject(*_geometry(scene_of(p)), "", -1, 0) for p in placed]
    geometry, by_link = _geometry(rt.Scene(shapes=(*(p.shape for p in placed), *COMPANY)))
    found = []
    for code, field, _, _ in TABLES:
        table = getattr(geometry.shapes, field)
        for i, owner in enumerate(np.broadcast_to(table.owner, len(table.face)).tolist()):
            if owner < len(placed):
                found.append((owner, Subject(geometry, by_link, field, code, i)))
    return [subject for _, subject in sorted(found, key=lambda pair: pair[0])]


def depart(subject: Subject, rays: Rays, ways: Ways, epsilon: float = 0.0) -> Departures:
    """Rays meet the shape and leave it; with an epsilon above 0, as textbooks do."""
    out = np.zeros((len(rays.o), COLUMNS))
    rows = np.full(len(rays.o), subject.row)
    geometry, shapes = subject.linked.tables
    with np.errstate(all="ignore"):
        _depart(geometry, shapes, subject.kind, rows, rays.o, rays.d, ways.local, epsilon, out)
    return Departures.of(out)


MITSUBA_KINDS = ("sphere", "rectangle", "disk", "triangle", "box", "cylinder", "mesh", "instance")
"""Kinds that it has itself, without proxy geometry."""


def depart_in_mitsuba(placed: Placed, rays: Rays, ways: Ways) -> Departures:
    """The same rays, in float32; in a scalar variant, which must be set: `scalar`."""
    out = np.zeros((len(rays.o), COLUMNS))
    out[:, 0] = out[:, 13] = np.inf
    mi = mitsuba()
    mi_scene = loaded(scene_of(placed))
    for k, (o, d, way) in enumerate(zip(*(a.tolist() for a in (*rays, *ways)), strict=True)):
        _depart_one(mi, mi_scene, o, d, way, out[k])
    return Departures.of(out)


def _depart_one(mi: Any, mi_scene: Any, o: list[float], d: list[float], way: Any, out: Any) -> None:
    si = mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(o), mi.Vector3f(d)))
    if not si.is_valid():
        return
    w = mi.Frame3f(si.n).to_world(mi.Vector3f(way))
    leaving = si.spawn_ray(w)
    met = mi_scene.ray_intersect(leaving)
    out[0] = si.t
    out[1:4], out[4:7], out[7:10], out[10:13] = si.p, si.n, leaving.o, leaving.d
    if met.is_valid():
        out[13], out[14] = met.t, float(np.dot(leaving.d, met.n))


def outer(ways: Ways, found: Departures) -> BoolArray:
    """Whether rays were to leave to the outer side; where float32 cannot decide (cosines below some
    hundred roundings of it), whether they begin there."""
    begun = np.sum((found.start - found.p) * found.n, axis=1) > 0.0
    return np.asarray(np.where(np.abs(ways.local[:, 2]) < 1e-5, begun, ways.outer))
