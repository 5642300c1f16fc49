"""Shapes of every kind, placed by maps that become extreme; rays that are aimed at them, meet them
and leave them, ours and Mitsuba's."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.meshes import ball, write_obj
from comparisons.experiments.stability.harness.series import Draw
from comparisons.experiments.stability.harness.shadows import bound
from comparisons.experiments.stability.harness.steps import matrix, vector
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.frame import round32
from reference_rt.core.arrays import FloatArray


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


def _mesh(linear: FloatArray, center: FloatArray, folder: Path, _rng: Any) -> Any:
    file = folder / "ball.obj"
    if not file.exists():
        mesh = ball(1, 1.0)
        write_obj(file, mesh.vertices, mesh.faces)
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


def scene_of(placed: Placed) -> rt.Scene:
    """The shape alone."""
    groups: Any = GROUPS if placed.kind == "instance" else {}
    return rt.Scene(shapes=(placed.shape,), groups=groups)


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
