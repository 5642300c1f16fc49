"""Ray casting: what the ray through each pixel's centre hits first, and nothing more."""

from typing import ClassVar, Literal, NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.description import Description
from reference_rt.geometry import closest_hit
from reference_rt.kernel import kernel
from reference_rt.ray import Ray
from reference_rt.shapes.shape import FloatArray
from reference_rt.tables import SceneTables
from reference_rt.vec3 import Vec3, length, row

LAYERS = ("colour", "distance", "normal", "id")


class RayCast(Description):
    """The display modes: one ray per pixel; all four layers are computed, one is the picture."""

    deterministic: ClassVar[bool] = True
    type: Literal["ray_cast"] = "ray_cast"
    show: Literal["colour", "distance", "normal", "id"] = "colour"
    """Which layer is the picture: the surface's own colour, the distance from the eye, the
    geometric normal, or the shape's index."""


class Cast(NamedTuple):
    """colour of the material;  distance, inf for a miss;  n, 0 for a miss;  id, -1 for a miss."""

    colour: Vec3
    distance: float
    n: Vec3
    id: int


@kernel
def cast(scene: SceneTables, colours: FloatArray, ray: Ray) -> Cast:
    """All layers of one ray; `colours` (materials, 3)."""
    nothing = Vec3(0.0, 0.0, 0.0)
    hit = closest_hit(scene.geometry, ray)
    if hit.kind < 0:
        return Cast(nothing, hit.t, nothing, -1)
    point = any_shape.surface(scene.geometry.shapes, ray, hit)
    owner = any_shape.owner(scene.geometry.shapes, ray, hit)
    return Cast(row(colours, point.material), hit.t * length(ray.d), point.n, owner.shape)
