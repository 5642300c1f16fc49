"""Area lights: every primitive whose material is emissive."""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.geometry import colour, on_triangle
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray, SurfacePoint
from reference_rt.core.vec3 import Vec3, dot
from reference_rt.jit.kernel import kernel
from reference_rt.jit.links import is_absent
from reference_rt.lights.light import NO_LIGHT, LightSample
from reference_rt.shapes import Shapes
from reference_rt.shapes.shape import LightPoint
from reference_rt.textures import NOWHERE, At, Colours, Textures, colour_at


class Areas(NamedTuple):
    """n emissive primitives: kind (n,) and row (n,) of the tables of shapes, radiance (n), area
    (n,), inf for one that the light sampler never picks and only scattered rays find."""

    kind: IntArray
    row: IntArray
    radiance: Colours
    area: FloatArray


@kernel
def sample(
    areas: Areas, i: int, shapes: Shapes, textures: Textures | None, p: Vec3, u0: float, u1: float
) -> LightSample:
    """A point of the light's surface; only its front emits."""
    q = any_shape.sample(shapes, areas.kind[i], areas.row[i], areas.area[i], p, u0, u1)
    return _from_point(areas, i, shapes, textures, p, q)


@kernel
def sample_fixed(
    areas: Areas, i: int, shapes: Shapes, textures: Textures | None, p: Vec3, u0: float, u1: float
) -> LightSample:
    """The point that represents the light where nothing is random."""
    q = any_shape.sample_fixed(shapes, areas.kind[i], areas.row[i], areas.area[i], p, u0, u1)
    return _from_point(areas, i, shapes, textures, p, q)


@kernel
def _from_point(
    areas: Areas, i: int, shapes: Shapes, textures: Textures | None, p: Vec3, q: LightPoint
) -> LightSample:
    if q.pdf == 0.0:
        return NO_LIGHT
    w = q.p - p
    distance = math.sqrt(dot(w, w))
    at = _texture_coordinates(textures, areas, i, shapes, p, w, q)
    return LightSample(
        w * (1.0 / distance),
        colour_at(areas.radiance, i, at),
        q.pdf,
        q.p + q.n * q.error,
        distance,
        False,
    )


@kernel
def _texture_coordinates(
    textures: Textures | None, areas: Areas, i: int, shapes: Shapes, p: Vec3, w: Vec3, q: LightPoint
) -> At:
    """The texture coordinates at a point q of light i."""
    none = Vec3(-1.0, -1.0, -1.0)
    if is_absent(textures):
        return At(textures, 0.0, 0.0, none, NOWHERE)
    hit = Hit(1.0, areas.kind[i], areas.row[i], q.u, q.v, -1)
    u, v = any_shape.uv(shapes, Ray(p, w, math.inf), hit)
    return At(textures, u, v, colour(shapes, hit, none), on_triangle(hit))


@kernel
def density(areas: Areas, i: int, shapes: Shapes, p: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle with which `sample` picks, from `p`, the point `q` on light i."""
    return any_shape.pdf(shapes, areas.kind[i], areas.row[i], areas.area[i], p, q)


@kernel
def emitted(areas: Areas, q: SurfacePoint, at: At, w: Vec3) -> Vec3:
    """The radiance that the surface at `q` emits towards `w`.

    The geometric normal decides which side is the front: a shading normal does not change where
    light comes from.  Mitsuba uses the shading normal.
    """
    if q.light < 0 or dot(q.n, w) <= 0.0:
        return Vec3(0.0, 0.0, 0.0)
    return colour_at(areas.radiance, q.light, at)
