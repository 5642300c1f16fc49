"""Area lights: every primitive whose material is emissive."""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.kernel import kernel
from reference_rt.lights.light import LightSample, no_light
from reference_rt.ray import SurfacePoint
from reference_rt.shapes import Shapes
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.vec3 import Vec3, dot, row


class Areas(NamedTuple):
    """n emissive primitives: kind and row say which, radiance (n, 3), area (n,)."""

    kind: IntArray
    row: IntArray
    radiance: FloatArray
    area: FloatArray


@kernel
def sample(areas: Areas, i: int, shapes: Shapes, p: Vec3, u0: float, u1: float) -> LightSample:
    """A point of the light's surface; only its front shines."""
    q = any_shape.sample(shapes, areas.kind[i], areas.row[i], areas.area[i], p, u0, u1)
    if q.pdf == 0.0:
        return no_light()
    w = q.p - p
    distance = math.sqrt(dot(w, w))
    return LightSample(
        w * (1.0 / distance),
        row(areas.radiance, i),
        q.pdf,
        q.p + q.n * q.error,
        distance,
        False,
    )


@kernel
def pdf(areas: Areas, i: int, shapes: Shapes, p: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle with which `sample` picks, from `p`, the point `q` on light i."""
    return any_shape.pdf(shapes, areas.kind[i], areas.row[i], areas.area[i], p, q)


@kernel
def emitted(areas: Areas | None, q: SurfacePoint, w: Vec3) -> Vec3:
    """The radiance that the surface at `q` emits towards `w`.

    The front is the geometric one: a shading normal does not change where light comes from.
    Mitsuba asks the shading normal.
    """
    if areas is None:
        return Vec3(0.0, 0.0, 0.0)
    if q.light < 0 or dot(q.n, w) <= 0.0:
        return Vec3(0.0, 0.0, 0.0)
    return row(areas.radiance, q.light)
