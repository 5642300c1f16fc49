"""In short: steps of transforms, rays at rows of tables, and scenes in Mitsuba as they are."""

import math
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons import translator
from comparisons.experiments.stability.harness.core import MITSUBA, OURS, FloatArray, U
from comparisons.geometry import frame
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.exact.crossings import Row
from comparisons.mitsuba import counterpart
from comparisons.mitsuba.backend import scalar
from comparisons.mitsuba.hits import MitsubaHits
from comparisons.mitsuba.scene import picture
from reference_rt.accel.geometry import Geometry, closest_hit, occluded, surface
from reference_rt.core.ray import Ray, SurfacePoint, ray_from
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate, Turn
from reference_rt.core.vec3 import Vec3, dot, row
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.rendering.query.links import link_to_geometry

# ---- rays, each at a row of a table of its own ---------------------------------------------------


_SHOWN = ("center", "radius", "to_local", "coefficients", "lower", "upper", "major", "minor")


class Rays(NamedTuple):
    """n rays, each with the table row of the shape that it is tested against.

    kind: a field of `reference_rt.shapes.Shapes`;  row: columns of n rows;  size (n,): the radius,
    or half the diagonal;  o, d (n, 3).
    """

    kind: str
    row: Row
    size: FloatArray
    o: FloatArray
    d: FloatArray

    def distance(self) -> FloatArray:
        """D (n,): of the origins from the shapes' centres."""
        return np.asarray(np.linalg.norm(self.o - self.row["center"], axis=1))

    def speed(self) -> FloatArray:
        return np.asarray(np.linalg.norm(self.d, axis=1))

    def columns(self) -> dict[str, FloatArray]:
        """The shapes and the rays, (n, k) each, as the examples of an outcome show them."""
        shown = {name: self.row[name] for name in _SHOWN if name in self.row}
        rows = shown | {"o": self.o, "d": self.d}
        return {name: np.reshape(column, (len(self.o), -1)) for name, column in rows.items()}

    def only(self, which: Any) -> "Rays":
        row = {name: np.asarray(column)[which] for name, column in self.row.items()}
        return Rays(self.kind, row, self.size[which], self.o[which], self.d[which])


def vector(v: Any) -> tuple[float, float, float]:
    """Three numbers of any kind as floats."""
    x, y, z = np.asarray(v, np.float64).tolist()
    return x, y, z


def at(x: float, y: float, z: float) -> Translate:
    return Translate(translate=(x, y, z))


def scaled(*factors: float) -> Scale:
    """By three factors, or by one in all directions."""
    x, y, z = factors * 3 if len(factors) == 1 else factors
    return Scale(scale=(x, y, z))


def turned(degrees: float, axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Rotate:
    return Rotate(rotate=Turn(axis=axis, degrees=degrees))


def any_turn(rng: np.random.Generator) -> Rotate:
    """By any angle about any axis."""
    axis = vector(unit_vectors(rng, 1)[0])
    return turned(float(rng.uniform(0.0, 360.0)), axis)


def matrix(linear: FloatArray, center: FloatArray) -> tuple[Matrix]:
    """The one step p -> linear p + center."""
    x, y, z = (tuple(row) for row in np.column_stack([linear, center]).tolist())
    return (Matrix(matrix=(x, y, z)),)


# ---- scenes and rays in Mitsuba as they are: not moved to where float32 is most precise ----------


def loaded(scene: rt.Scene) -> Any:
    """Mitsuba's scene, in the variant that is set."""
    return translator.load(scene, frame.OURS).mi_scene


def traced(scene: rt.Scene, o: FloatArray, d: FloatArray) -> MitsubaHits:
    """The closest hits of rays (n, 3) in it."""
    return counterpart.trace(translator.load(scene, frame.OURS), o, d)


def rendered(scene: rt.Scene, spp: int, seed: int) -> FloatArray:
    """(height, width, 3)."""
    return picture(loaded(scene), spp, seed)


PIXELS = 160
"""Across a picture."""

EPSILON = 1e-4
"""Of the textbook's offset."""

CONTACT = 4.0
"""Bounds B: a shape that is thicker must not be lost, nor a neighbour that is farther away."""


def bound(largest: float, size: float) -> float:
    """B: how far a ray may begin off the surface, whatever the shape is: `surface_error`'s
    16 sqrt(3) u (|anchor| + |p| + extent), where anchors and points have coordinates below
    `largest`, that of the middle, + sqrt(3) size, and extents about the anchor are below 3 size;
    and the rounding of the sum, another sqrt(3) u of a part of that."""
    return 17.0 * math.sqrt(3.0) * U * (2.0 * largest + 6.0 * size)


@kernel
def ray_leaving(ray: Ray, t: float, point: SurfacePoint, w: Vec3, epsilon: float) -> Ray:
    """Ours, or for an epsilon above 0 the textbook's ray: it begins at o + t d, and what is nearer
    than epsilon does not count, so that it might as well begin there."""
    if epsilon > 0.0:
        return Ray(ray.o + ray.d * t + w * epsilon, w, math.inf)
    return ray_from(point, w)


@entry_kernel
def _lit(
    geometry: Geometry, o: FloatArray, d: FloatArray, w: FloatArray, epsilon: float, out: FloatArray
) -> None:
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        hit = closest_hit(geometry, ray)
        out[i, 0] = -1.0
        if hit.kind >= 0:
            point, towards = surface(geometry, ray, hit), row(w, i)
            leaving = ray_leaving(ray, hit.t, point, towards, epsilon)
            out[i, 0] = 0.0 if occluded(geometry, leaving) else 1.0
            out[i, 1] = abs(dot(towards, point.n))


def lit(
    contestant: str, scene: rt.Scene, o: FloatArray, d: FloatArray, w: FloatArray
) -> FloatArray:
    """(n, 2) of rays: 1 where the surface that they meet is lit from w, 0 in shadow, -1 for a miss;
    the cosine of w to the surface."""
    out = np.zeros((len(o), 2))
    if contestant == MITSUBA:
        with scalar() as mi:
            mi_scene = loaded(scene)
            for k, (begin, way, to) in enumerate(
                zip(o.tolist(), d.tolist(), w.tolist(), strict=True)
            ):
                si = mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(begin), mi.Vector3f(way)))
                out[k, 0] = -1.0
                if si.is_valid():
                    out[k, 0] = not mi_scene.ray_test(si.spawn_ray(mi.Vector3f(to)))
                    out[k, 1] = abs(float(np.dot(si.n, to)))
        return out
    epsilon = 0.0 if contestant == OURS else EPSILON
    found = link_to_geometry(rt.build_tables(scene), "closest_hit", "surface", "occluded")
    _lit(found.tables, o, d, w, epsilon, out)
    return out


def light_picture(found: FloatArray) -> Any:
    """(PIXELS, PIXELS, 3): surfaces in grey by their cosine, black in shadow; misses are blue."""
    grey = np.where(found[:, 0] > 0.0, 60.0 + 180.0 * found[:, 1], 12.0)
    rgb = np.repeat(grey[:, None], 3, axis=1)
    rgb[found[:, 0] < 0.0] = (40.0, 60.0, 90.0)
    return rgb.reshape(PIXELS, PIXELS, 3).astype(np.uint8)
