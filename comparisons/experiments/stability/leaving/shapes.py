"""Shapes of every kind, placed by maps that become extreme; rays that are aimed at them, meet them
and leave them, ours and Mitsuba's."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

import reference_rt as rt
from comparisons.experiments.stability.harness.core import Draw
from comparisons.experiments.stability.harness.meshes import write_obj
from comparisons.experiments.stability.harness.steps import (
    bound,
    loaded,
    matrix,
    ray_leaving,
    vector,
)
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import mitsuba
from reference_rt import shapes as any_shape
from reference_rt.accel.geometry import Geometry, closest_hit, surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray, SurfacePoint
from reference_rt.core.vec3 import Vec3, dot, frame_from_normal, row, to_world
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.jit.links import Linker
from reference_rt.rendering.linking import geometry_of, linked_shapes
from reference_rt.rendering.query.links import Linked, linked
from reference_rt.shapes import Shapes
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.tables import TABLES, by_code


class Extent(NamedTuple):
    """The shapes of a sweep point: sizes are 10^size, one axis is `ratio` times as long as another,
    and `distance` sizes lie between the origin and a shape.  single: whether every number of shapes
    and rays is rounded to float32 first, so that Mitsuba gets the very same."""

    size: tuple[float, float]
    ratio: tuple[float, float]
    distance: tuple[float, float]
    single: bool

    @classmethod
    def of(cls, size: float, ratio: float, distance: float, single: bool) -> "Extent":
        """Of these very numbers."""
        sizes = math.log10(size)
        return cls((sizes, sizes), (ratio, ratio), (distance, distance), single)


@dataclass(frozen=True)
class Placed:
    """A shape p = center + A q of a kind of unit size.

    shape: the description;  linear (3, 3): A;  size: its longest column's length.
    """

    kind: str
    shape: Any
    linear: FloatArray
    center: FloatArray
    size: float

    @property
    def bound(self) -> float:
        """B: how far a ray may begin off the surface."""
        return bound(float(np.abs(self.center).max()), self.size)


class Kind(NamedTuple):
    """make(linear, center, folder, rng): the shape's description;  inside(rng, n): points (n, 3) of
    its own coordinates, well inside, at which rays are aimed;  closed: whether it encloses space;
    convex: whether no line from the outer side of its surface meets it again; of flat shapes from
    both sides."""

    make: Callable[[FloatArray, FloatArray, Path, np.random.Generator], Any]
    inside: Callable[[np.random.Generator, int], FloatArray]
    closed: bool
    convex: bool


def _placed(shape: Any, **fields: Any) -> Callable[..., Any]:
    def make(linear: FloatArray, center: FloatArray, _folder: Path, _rng: Any) -> Any:
        return shape(transform=matrix(linear, center), **fields)

    return make


def _sphere(linear: FloatArray, center: FloatArray, _folder: Path, _rng: Any) -> Any:
    return rt.Sphere(center=tuple(center.tolist()), radius=float(np.linalg.norm(linear[:, 0])))


CORNERS = np.array([[math.cos(a), math.sin(a), 0.0] for a in (0.1, 2.0, 4.3)])
"""Of the triangle."""


def _triangle(linear: FloatArray, center: FloatArray, _folder: Path, _rng: Any) -> Any:
    v = (CORNERS @ linear.T + center).tolist()
    return rt.Triangle(v0=tuple(v[0]), v1=tuple(v[1]), v2=tuple(v[2]))


@functools.cache
def _ball() -> Any:
    return trimesh.creation.icosphere(subdivisions=1)


def _mesh(linear: FloatArray, center: FloatArray, folder: Path, _rng: Any) -> Any:
    file = folder / "ball.obj"
    if not file.exists():
        write_obj(file, _ball().vertices, _ball().faces)
    return rt.Mesh(file=str(file), transform=matrix(linear, center))


def _torus(linear: FloatArray, center: FloatArray, _folder: Path, rng: np.random.Generator) -> Any:
    minor = float(np.float32(rng.uniform(TUBE, 0.6)))
    return rt.Torus(major_radius=1.0, minor_radius=minor, transform=matrix(linear, center))


TUBE = 0.125
"""The thinnest tube of a torus."""


def _flat(points: FloatArray) -> FloatArray:
    return np.column_stack([points, np.zeros(len(points))])


def _in_disk(rng: np.random.Generator, n: int) -> FloatArray:
    r, phi = 0.9 * np.sqrt(rng.random(n)), rng.uniform(0.0, 2.0 * math.pi, n)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi)])


def _in_triangle(rng: np.random.Generator, n: int) -> FloatArray:
    weights = 0.9 * rng.dirichlet((1.0, 1.0, 1.0), n) + 0.1 / 3.0
    return np.asarray(weights @ CORNERS)


def _in_ell(rng: np.random.Generator, n: int) -> FloatArray:
    """Inside of the polygon: the square without its upper right quarter."""
    points = rng.uniform(-0.95, -0.05, (n, 2))
    points[rng.random(n) < 0.5, 0] += 1.0
    return np.asarray(points[:, ::-1] if rng.random() < 0.5 else points)


def _in_cone(rng: np.random.Generator, n: int) -> FloatArray:
    z = rng.uniform(0.05, 0.9, n)
    return np.column_stack([_in_disk(rng, n) * (1.0 - z)[:, None], z])


def _in_bowl(rng: np.random.Generator, n: int) -> FloatArray:
    z = rng.uniform(0.05, 0.9, n)
    return np.column_stack([_in_disk(rng, n) * np.sqrt(z)[:, None], z])


def _in_ring(rng: np.random.Generator, n: int) -> FloatArray:
    phi = rng.uniform(0.0, 2.0 * math.pi, n)
    middle = np.column_stack([np.cos(phi), np.sin(phi), np.zeros(n)])
    return np.asarray(middle + rng.uniform(-0.5, 0.5, (n, 3)) * TUBE)


def _in_ball(rng: np.random.Generator, n: int) -> FloatArray:
    # The ball of triangles holds one of 0.9.
    return np.asarray(unit_vectors(rng, n) * (0.85 * np.cbrt(rng.random((n, 1)))))


def _below_the_hollow(rng: np.random.Generator, n: int) -> FloatArray:
    return np.asarray(rng.uniform((-0.9, -0.9, -0.9), (0.9, 0.9, 0.2), (n, 3)))


_ELL = ((-1.0, -1.0), (1.0, -1.0), (1.0, 0.0), (0.0, 0.0), (0.0, 1.0), (-1.0, 1.0))
_BOWL = (1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0)  # x² + y² - z

KINDS = {
    "sphere": Kind(_sphere, _in_ball, True, True),
    "rectangle": Kind(
        _placed(rt.Rectangle), lambda r, n: _flat(r.uniform(-0.9, 0.9, (n, 2))), False, True
    ),
    "disk": Kind(_placed(rt.Disk), lambda r, n: _flat(_in_disk(r, n)), False, True),
    "triangle": Kind(_triangle, _in_triangle, False, True),
    "polygon": Kind(
        _placed(rt.Polygon, rings=(_ELL,)), lambda r, n: _flat(_in_ell(r, n)), False, True
    ),
    "plane": Kind(_placed(rt.Plane), lambda r, n: _flat(r.uniform(-0.9, 0.9, (n, 2))), False, True),
    "box": Kind(_placed(rt.Box), lambda r, n: r.uniform(-0.9, 0.9, (n, 3)), True, True),
    "ellipsoid": Kind(_placed(rt.Sphere), _in_ball, True, True),
    "cylinder": Kind(
        _placed(rt.Cylinder, z_min=-1.0),
        lambda r, n: np.column_stack([_in_disk(r, n), r.uniform(-0.9, 0.9, n)]),
        True,
        True,
    ),
    "cone": Kind(_placed(rt.Cone), _in_cone, True, True),
    "paraboloid": Kind(
        _placed(
            rt.Quadric,
            coefficients=_BOWL,
            lower=(-1.0, -1.0, 0.0),
            upper=(1.0, 1.0, 1.0),
            capped=True,
        ),
        _in_bowl,
        True,
        True,
    ),
    "torus": Kind(_torus, _in_ring, True, False),
    "mesh": Kind(_mesh, _in_ball, True, True),
    "solid": Kind(
        _placed(rt.Difference, of=(rt.Box(), rt.Sphere(center=(0.0, 0.0, 1.0), radius=0.75))),
        _below_the_hollow,
        True,
        False,
    ),
    "instance": Kind(_placed(rt.Instance, group="ball"), _in_ball, True, True),
}

GROUPS = {"ball": (rt.Sphere(),)}

WHOLE = ("mesh", "solid", "instance")
"""Kinds that are more than a row of a table: each of them is a scene of its own."""


def _rotation(rng: np.random.Generator) -> FloatArray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0.0 else -q)


def place(kind: str, extent: Extent, draw: Draw) -> Placed:
    """One of a kind, placed at random: stretched along its own axes, then turned."""
    rng = draw.rng
    size = 10.0 ** rng.uniform(*extent.size)
    if kind == "sphere":  # what is not round is an ellipsoid
        extent = extent._replace(ratio=(1.0, 1.0))
    ratio = rng.uniform(*np.log10(extent.ratio))
    powers = np.array([0.0, rng.uniform(-ratio, 0.0), -ratio])
    stretch = size * 10.0 ** rng.permutation(powers)
    linear = _rotation(rng) * stretch
    far = 10.0 ** rng.uniform(*np.log10(extent.distance)) if extent.distance[1] > 0.0 else 0.0
    center = unit_vectors(rng, 1)[0] * (far * size)
    if extent.single:
        linear, center = round32(linear), round32(center)
    shape = KINDS[kind].make(linear, center, draw.folder, rng)
    if extent.single and kind == "triangle":
        corners: Any = {k: vector(round32(np.array(getattr(shape, k)))) for k in ("v0", "v1", "v2")}
        shape = rt.Triangle(**corners)
    return Placed(kind, shape, linear, center, float(np.linalg.norm(linear, axis=0).max()))


class Rays(NamedTuple):
    """Rays (n, 3), d unit, from outside towards what is inside of a shape."""

    o: FloatArray
    d: FloatArray


def aim(placed: Placed, n: int, single: bool, rng: np.random.Generator) -> Rays:
    """Rays from some sizes away, as the shape's own coordinates see it."""
    begin = unit_vectors(rng, n) * rng.uniform(2.0, 8.0, (n, 1))
    begin[np.abs(begin[:, 2]) < 0.1, 2] = 0.5  # flat shapes are not to be seen edge-on
    target = KINDS[placed.kind].inside(rng, n)
    o = begin @ placed.linear.T + placed.center
    if single:
        o = round32(o)
    d = (target @ placed.linear.T + placed.center) - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    if single:
        d = round32(d)
    return Rays(np.ascontiguousarray(o), np.ascontiguousarray(d))


# ---- compiled loops: rays meet a shape, leave it, and are traced again ---------------------------


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

    return geometry, linked(tables, "leaving", link, (geometry, geometry.shapes))


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


def scene_of(placed: Placed) -> rt.Scene:
    """The shape alone."""
    groups: Any = GROUPS if placed.kind == "instance" else {}
    return rt.Scene(shapes=(placed.shape,), groups=groups)


def depart(subject: Subject, rays: Rays, ways: Ways, epsilon: float = 0.0) -> Departures:
    """Rays meet the shape and leave it; with an epsilon above 0, as textbooks do."""
    out = np.zeros((len(rays.o), COLUMNS))
    rows = np.full(len(rays.o), subject.row)
    geometry, shapes = subject.linked.tables
    with np.errstate(all="ignore"):
        _depart(geometry, shapes, subject.kind, rows, rays.o, rays.d, ways.local, epsilon, out)
    return Departures.of(out)


# ---- Mitsuba's rays that leave a surface: `si.spawn_ray` -----------------------------------------


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
