"""F1's rays at ellipsoids, cylinders, cones, paraboloids, hyperboloids and tori."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from comparisons.experiments.stability.far.law import judge_by_moving
from comparisons.experiments.stability.far.spheres import RAYS, SCENES, in_mitsuba, tangent_gaps
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    unit_of,
)
from comparisons.experiments.stability.harness.rays import Rays
from comparisons.experiments.stability.harness.series import Draw
from comparisons.experiments.stability.harness.steps import matrix
from comparisons.geometry.affine import across, unit_vectors
from comparisons.geometry.exact.dyadic import Dyadic
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import scalar
from reference_rt.core.arrays import IntArray
from reference_rt.core.transform import Transform, rotate
from reference_rt.jit.kernel import by_class, entry_kernel
from reference_rt.shapes import TABLES, Cone, Cylinder, Quadric, Sphere, Torus
from reference_rt.shapes.curved.quadrics import Quadrics
from reference_rt.shapes.curved.torus import Tori
from reference_rt.shapes.shape import Shape, TabulationContext
from reference_rt.textbook.method import ray_of

MINOR = 0.25
"""The tube's radius of a torus whose ring has radius 1."""

Points = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


class Kind(NamedTuple):
    """table: its field of `Shapes`;  make: of a transform;  surface: points (n, 3) and normals of
    any length, in the shape's own coordinates, for angles from 0 to 2 pi and heights from -1 to
    1."""

    table: str
    make: Callable[[Transform], Shape]
    surface: Points


def _turned(
    radius: Callable[[FloatArray], FloatArray], slope: Callable[[FloatArray], FloatArray]
) -> Points:
    """A surface of revolution: rho(z) and its derivative."""

    def surface(phi: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        rho, c, s = radius(z), np.cos(phi), np.sin(phi)
        return np.column_stack([rho * c, rho * s, z]), np.column_stack([c, s, -slope(z)])

    return surface


def _ball(phi: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    rho = np.sqrt(1.0 - z * z)
    p = np.column_stack([rho * np.cos(phi), rho * np.sin(phi), z])
    return p, p


def _ring(phi: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    around, out = np.pi * z, np.column_stack([np.cos(phi), np.sin(phi), np.zeros(len(phi))])
    n = out * np.cos(around)[:, None] + np.sin(around)[:, None] * [0.0, 0.0, 1.0]
    return out + MINOR * n, n


def _bowl(z: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(0.5 * (z + 1.0)))


def _waist(z: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(0.25 + z * z))


_TWO = (2.0, 2.0, 1.0)
_UNIT = ((-2.0, -2.0, -1.0), _TWO)

KINDS: Mapping[str, Kind] = {
    "ellipsoid": Kind("quadrics", lambda m: Sphere(transform=m), _ball),
    "cylinder": Kind(
        "quadrics",
        lambda m: Cylinder(z_min=-1.0, capped=False, transform=m),
        _turned(np.ones_like, np.zeros_like),
    ),
    "cone": Kind(
        "quadrics",
        lambda m: Cone(height=1.0, transform=m),
        lambda phi, z: _turned(lambda h: 1.0 - h, lambda h: -np.ones_like(h))(phi, 0.5 * (z + 1.0)),
    ),
    "paraboloid": Kind(
        "quadrics",
        lambda m: Quadric(
            coefficients=(2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, -1.0),
            lower=_UNIT[0],
            upper=_UNIT[1],
            transform=m,
        ),
        _turned(_bowl, lambda z: 0.25 / np.maximum(_bowl(z), 1e-3)),
    ),
    "hyperboloid": Kind(
        "quadrics",
        lambda m: Quadric(
            coefficients=(1.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.25),
            lower=_UNIT[0],
            upper=_UNIT[1],
            capped=True,
            transform=m,
        ),
        _turned(_waist, lambda z: z / _waist(z)),
    ),
    "torus": Kind("tori", lambda m: Torus(minor_radius=MINOR, transform=m), _ring),
}

REACH = 2.0
"""No point of a shape of size 1, stretched by up to this, is further from its middle than sqrt(2)
times it: the size that bounds are counted in."""

STRETCH = (0.5, REACH)
"""Of an ellipsoid's axes, and of all others' but a cylinder's, which Mitsuba has only round."""


def _map(rng: np.random.Generator, name: str, size: float) -> FloatArray:
    """A linear map (3, 3) in numbers that float32 has."""
    turn = rotate(tuple(unit_vectors(rng, 1)[0].tolist()), float(rng.uniform(0.0, 360.0)))[:, :3]
    stretch = np.ones(3) if name == "cylinder" else rng.uniform(*STRETCH, 3)
    return round32(size * turn * stretch)


def _shape(kind: Kind, linear: FloatArray, center: FloatArray) -> Shape:
    return kind.make(matrix(linear, center))


def draw_rays(
    rng: np.random.Generator, name: str, distance: FloatArray, offset: float, size: float
) -> tuple[Rays, list[FloatArray]]:
    """(rays, the maps of the shapes, which ray i has number i % SCENES of).

    Half of the rays aim about the shape, half along its surface, 2^-1 to 2^-40 sizes above or below
    it.  Rounding a ray that comes from afar moves it by many times the smallest gaps: the shapes'
    centres are chosen afterwards, each for its ray.
    """
    kind, n = KINDS[name], len(distance)
    maps = [_map(rng, name, size) for _ in range(SCENES)]
    which = np.arange(n) % SCENES
    linear = np.array(maps)[which]
    q, local_n = kind.surface(rng.uniform(0.0, 2.0 * np.pi, n), rng.uniform(-1.0, 1.0, n))
    normal = np.einsum("nji,nj->ni", np.linalg.inv(linear), local_n)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tangent = rng.random(n) < 0.5
    gap = np.where(tangent, tangent_gaps(rng, n), 0.0)
    # From the shape's middle to the point that the ray passes through.
    reach = np.where(tangent[:, None], q, q * rng.uniform(0.0, 1.2, (n, 1)))
    passed = np.einsum("nij,nj->ni", linear, reach) + normal * (gap * size)[:, None]
    d = np.where(tangent[:, None], across(rng, normal), unit_vectors(rng, n))
    center = offset * size * unit_vectors(rng, n) + size * rng.uniform(-1.0, 1.0, (n, 3))
    far = size * distance
    o = center + passed - d * far[:, None]
    d = d * 10.0 ** rng.uniform(-3.0, 3.0, (n, 1))
    at = far / np.linalg.norm(d, axis=1)
    foot = Dyadic.of(o) + Dyadic.of(d) * Dyadic.of(at[:, None])
    center = foot.floats() - passed
    columns = _columns([_shape(kind, m, np.zeros(3)) for m in maps], which)
    # Where the table has its origin is not where the shape has its own: a bowl's, a frustum's.
    moved = center + columns["center"]
    return Rays(kind.table, columns | {"center": moved}, np.full(n, REACH * size), o, d), maps


def _columns(shapes: list[Shape], which: IntArray) -> dict[str, Any]:
    """The columns of a table, of whose row i shape number which[i] is."""
    rows = [shape.tabulate(TabulationContext())._asdict() for shape in shapes]
    return {key: np.concatenate([row[key] for row in rows])[which] for key in rows[0]}


def answer(rays: Rays) -> FloatArray:
    """t (n,) by our kernel, inf for a miss."""
    t = np.empty(len(rays.o))
    of = Quadrics if rays.kind == "quadrics" else Tori
    table = of(**{name: np.ascontiguousarray(column) for name, column in rays.row.items()})
    with np.errstate(all="ignore"):
        _first(table, rays.o, rays.d, t)
    return t


_intersect_row = by_class("intersect", {one.table: one.module.intersect for one in TABLES})


@entry_kernel
def _first(table: Any, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = _intersect_row(table, i, ray_of(o, d, i)).t


IN_MITSUBA = ("ellipsoid", "cylinder")
"""What it has: ellipsoids as instances of a sphere.  The others are meshes there."""


def compete(
    draw: Draw, name: str, distance: FloatArray, offset: float = 0.0, size: float = 1.0
) -> Outcomes:
    """Ours; and Mitsuba on some of the rays, rounded to float32 with their shapes, against the
    exact answer for these and the law in float32's u."""
    rays, maps = draw_rays(draw.rng, name, distance, offset, size)
    found = {OURS: judge_by_moving(rays, answer(rays))}
    if draw.mitsuba and name in IN_MITSUBA:
        rounded, shapes = _for_mitsuba(name, rays, maps)
        t = np.empty(len(rounded.o))
        with scalar():
            for k, shape in enumerate(shapes):
                t[k::SCENES] = in_mitsuba(shape, rounded.o[k::SCENES], rounded.d[k::SCENES])
        found[MITSUBA] = judge_by_moving(rounded, t, unit_of(MITSUBA))
    return found


def _for_mitsuba(name: str, rays: Rays, maps: list[FloatArray]) -> tuple[Rays, list[Shape]]:
    few = rays.only(np.arange(min(RAYS, len(rays.o))))
    which = np.arange(len(few.o)) % SCENES
    centers = round32(few.row["center"][:SCENES])
    o = round32(few.o - few.row["center"] + few.row["center"][which])
    shapes = [_shape(KINDS[name], m, c) for m, c in zip(maps, centers, strict=True)]
    return Rays(
        rays.kind, _columns(shapes, which), few.size, o, round32(few.d / few.speed()[:, None])
    ), shapes
