"""Ray casting: the first hit of the ray through each pixel's centre, as colour and other AOVs."""

import math
from typing import ClassVar, Literal, NamedTuple

from reference_rt.accel.geometry import closest_hit, colour, coordinates, owner
from reference_rt.core.model import Description, Examples
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, length
from reference_rt.integrators.scene_tables import KernelScene, surface
from reference_rt.integrators.shading import texture_place
from reference_rt.jit.kernel import kernel
from reference_rt.textures import colour_at

LAYERS = ("colour", "distance", "normal", "id", "uv")


class RayCast(Description):
    """One ray through each pixel's centre, without light: colours, distances, normals, indices,
    coordinates.

    All layers are computed; `show` selects the picture.
    """

    EXAMPLES: ClassVar[Examples] = tuple(
        {"show": what} for what in ("colour", "distance", "normal", "id", "uv")
    )
    deterministic: ClassVar[bool] = True
    follows_scattered: ClassVar[bool] = False
    type: Literal["ray_cast"] = "ray_cast"
    show: Literal["colour", "distance", "normal", "id", "uv"] = "colour"
    """The layer that is the picture: the surface's own colour, the distance from the eye in scene
    units, the geometric normal in world coordinates, the index of the shape, or the surface
    coordinates (u, v)."""


class Cast(NamedTuple):
    """All layers at one ray.  colour: interpolated vertex colour, or the material's;  distance: inf
    for a miss;  n: unit geometric normal, 0 for a miss;  id: index of the shape, -1 for a miss;
    u, v: surface coordinates, 0 for a miss."""

    colour: Vec3
    distance: float
    n: Vec3
    id: int
    u: float
    v: float


@kernel
def cast(scene: KernelScene, ray: Ray) -> Cast:
    """All layers of one ray."""
    nothing = Vec3(0.0, 0.0, 0.0)
    hit = closest_hit(scene.geometry, ray)
    if hit.kind < 0:
        return Cast(nothing, math.inf, nothing, -1, 0.0, 0.0)
    point = surface(scene, ray, hit)
    whose, where = owner(scene.geometry, hit), coordinates(scene.geometry, ray, hit)
    at = texture_place(scene.textures, scene.geometry, ray, hit)
    own = colour_at(scene.materials.shown, point.material, at)
    shown = colour(scene.shapes, hit, own)
    return Cast(shown, hit.t * length(ray.d), point.n, whose.shape, where.u, where.v)
