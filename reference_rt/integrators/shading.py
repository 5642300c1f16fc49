"""From a hit to the input of the BSDF: the point, its shading frame, its texture lookups."""

from reference_rt.accel.geometry import Geometry, coordinates, on_triangle, tangents
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import Hit, Ray, SurfacePoint
from reference_rt.core.vec3 import Frame, Vec3, frame_from_normal, to_local
from reference_rt.integrators.scene_tables import KernelScene, surface
from reference_rt.jit.kernel import kernel
from reference_rt.jit.links import is_absent
from reference_rt.materials import Materials, Shading, is_oriented, prepare, uses_textures
from reference_rt.materials.material import oriented_frame
from reference_rt.materials.textured import evaluate_textures, lookup_cache_size
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import NOWHERE, At, Textures

_NO_COLOUR = Vec3(-1.0, -1.0, -1.0)


@kernel
def shade(scene: KernelScene, ray: Ray, hit: Hit, kept: FloatArray) -> Shading:
    """The BSDF's input at a hit (not a miss), seen along the ray.

    kept (`materials.scratch_floats`,): buffer for texture values and layers; the result refers to
    it.
    """
    return shade_point(scene, ray, hit, surface(scene, ray, hit), kept)


@kernel
def shade_point(
    scene: KernelScene, ray: Ray, hit: Hit, point: SurfacePoint, kept: FloatArray
) -> Shading:
    """The same, where the `surface` of the hit is known."""
    return shade_towards(scene, ray, hit, point, -ray.d, kept)


@kernel
def shade_towards(
    scene: KernelScene, ray: Ray, hit: Hit, point: SurfacePoint, wo: Vec3, kept: FloatArray
) -> Shading:
    """The same, seen from the unit direction `wo` in place of the ray's."""
    frame, local = frame_at(scene.materials, scene.geometry, ray, hit, point)
    at = place(scene, point.material, ray, hit)
    looked = evaluate_textures(scene.materials.textured, point.material, at, kept)
    flat_leaves = kept[lookup_cache_size(scene.materials.textured) :]
    shading = Shading(point, frame, to_local(frame, wo), looked, local, flat_leaves)
    prepare(scene.materials, shading, at)
    return shading


@kernel
def place(scene: KernelScene, m: int, ray: Ray, hit: Hit) -> At:
    """Texture coordinates at a hit for material m; any, if it has no textures."""
    if not uses_textures(scene.materials, m):
        return At(scene.textures, 0.0, 0.0, _NO_COLOUR, NOWHERE)
    return texture_place(scene.textures, scene.geometry, ray, hit)


@kernel
def texture_place(textures: Textures | None, geometry: Geometry, ray: Ray, hit: Hit) -> At:
    """Texture coordinates at a hit; computed only if the scene has textures."""
    if is_absent(textures):
        return At(textures, 0.0, 0.0, _NO_COLOUR, NOWHERE)
    found = coordinates(geometry, ray, hit)
    return At(textures, found.u, found.v, found.colour, on_triangle(hit))


@kernel
def frame_at(
    materials: Materials, geometry: Geometry, ray: Ray, hit: Hit, point: SurfacePoint
) -> tuple[Frame, Tangents]:
    """The shading frame, and the tangents in it, which are 0 for materials that need none: on a
    floor under a brushed ball they took a twentieth of the time (measured)."""
    zero = Vec3(0.0, 0.0, 0.0)
    if not is_oriented(materials, point.material):
        return frame_from_normal(point.ns), Tangents(zero, zero)
    world = tangents(geometry, ray, hit)
    frame = oriented_frame(point.ns, world)
    return frame, Tangents(to_local(frame, world.dpdu), to_local(frame, world.dpdv))
