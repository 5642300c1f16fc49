"""Lamps that are not seen directly: camera rays go on behind them."""

from typing import NamedTuple

from reference_rt import lights as any_light
from reference_rt.accel.block_query import closest_hits, hit_of
from reference_rt.accel.geometry import closest_hit
from reference_rt.core.ray import Hit, Ray, ray_from
from reference_rt.core.ray_block import HitBlock, RayBlock, put_ray, ray_of
from reference_rt.integrators.scene_tables import SceneTables, surface
from reference_rt.jit.kernel import kernel


class Onward(NamedTuple):
    """is_lamp: whether a ray's hit is on an area light;  ray: the rest of the ray behind it."""

    is_lamp: bool
    ray: Ray


@kernel
def onward(scene: SceneTables, ray: Ray, hit: Hit) -> Onward:
    if hit.kind < 0:
        return Onward(False, ray)
    point = surface(scene, ray, hit)
    if not any_light.is_area(scene.lights, point):
        return Onward(False, ray)
    rest = ray_from(point, ray.d)
    return Onward(True, Ray(rest.o, rest.d, ray.t_max - hit.t))


@kernel
def behind_lamps(scene: SceneTables, ray: Ray) -> Ray:
    """The rest of a ray behind the area lights that it meets before any other surface."""
    going = Onward(True, ray)
    while going.is_lamp:
        going = onward(scene, going.ray, closest_hit(scene.geometry, going.ray))
    return going.ray


@kernel
def pass_lamps(scene: SceneTables, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """The same for the first n rays of a block."""
    is_going = True
    while is_going:
        closest_hits(scene.geometry, rays, hits, n)
        is_going = False
        for j in range(n):
            ray = ray_of(rays, j)
            going = onward(scene, ray, hit_of(scene.geometry, ray, hits, j))
            if going.is_lamp:
                put_ray(rays, j, going.ray)
                is_going = True
