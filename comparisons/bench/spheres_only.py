"""A path tracer for spheres in diffuse colours under a white sky, and for nothing else.

What is left of `reference_rt`'s kernels when everything that such a scene does not use is deleted
by hand: no table that may be absent, no choice among shapes, materials, lights, cameras, samplers
or filters, no textures, no hierarchy.  It gives the same picture bit for bit (its test), and its
time is what the renderer's own pruning is measured against.
"""

import math
from typing import NamedTuple

import numpy as np

from reference_rt import sampling
from reference_rt.cameras import LENS_CENTRE
from reference_rt.cameras.perspective import PerspectiveView, camera_ray
from reference_rt.film import BoxFilter
from reference_rt.integrators import Path
from reference_rt.integrators.integrator import power_heuristic
from reference_rt.integrators.path import ROULETTE_CAP
from reference_rt.kernel import entry_kernel, kernel, local_floats
from reference_rt.lanes import LANES
from reference_rt.lights import Constant
from reference_rt.lights.constant import PDF
from reference_rt.materials import Diffuse
from reference_rt.materials.material import INV_PI
from reference_rt.ray import Hit, Ray, ray_from
from reference_rt.sampling import Sobol, sobol
from reference_rt.sampling.warp import cosine_hemisphere, uniform_sphere
from reference_rt.scene import Scene
from reference_rt.shapes import SPHERE, Sphere, sphere
from reference_rt.shapes.shape import FloatArray, nearest_lane
from reference_rt.shapes.sphere import Spheres
from reference_rt.vec3 import (
    Vec3,
    frame_from_normal,
    is_black,
    max_component,
    row,
    to_local,
    to_world,
)


class World(NamedTuple):
    """spheres, packets: their table, and side by side;  reflectance (n, 3) of the materials;  sky:
    its radiance."""

    spheres: Spheres
    packets: FloatArray
    reflectance: FloatArray
    sky: Vec3


def world_of(scene: Scene) -> World:
    """The scene as the kernels here see it.  Raises ValueError where it has more than they know."""
    environment = scene.lights[0] if len(scene.lights) == 1 else None
    if not (
        all(isinstance(shape, Sphere) for shape in scene.shapes)
        and all(isinstance(material, Diffuse) for material in scene.materials.values())
        and isinstance(environment, Constant)
        and isinstance(scene.integrator, Path)
        and scene.integrator.sampling == "both"
        and isinstance(scene.sampler, Sobol)
        and isinstance(scene.film.filter, BoxFilter)
    ):
        raise ValueError("expected diffuse spheres under a constant sky, path traced")
    geometry = scene.tables.geometry
    spheres, packets = geometry.shapes.spheres, geometry.packets.spheres
    if spheres is None or packets is None:
        raise ValueError("expected spheres, so few that no hierarchy leads to them")
    colours = [m.reflectance for m in scene.materials.values() if isinstance(m, Diffuse)]
    return World(spheres, packets, np.array(colours), Vec3(*environment.radiance))


@kernel
def _nearest(world: World, ray: Ray) -> Hit:
    distances = local_floats(LANES)
    best, t = -1, math.inf
    for k in range(len(world.packets)):
        for lane in range(LANES):
            distances[lane] = sphere.lane_distance(world.spheres, world.packets, k, lane, ray)
        best, t = nearest_lane(distances, k, best, t)
    return Hit(t, SPHERE, best, 0.0, 0.0, -1)


@kernel
def _radiance(
    max_depth: int, rr_depth: int, world: World, ray: Ray, sampler: sobol.SobolSample
) -> Vec3:
    total = Vec3(0.0, 0.0, 0.0)
    throughput = Vec3(1.0, 1.0, 1.0)
    bsdf_pdf = 0.0
    for depth in range(max_depth):
        hit = _nearest(world, ray)
        if hit.row < 0:
            weight = 1.0
            if bsdf_pdf > 0.0:
                weight = power_heuristic(bsdf_pdf, PDF)
            total = total + throughput * world.sky * weight
            break
        point = sphere.surface(world.spheres, ray, hit)
        frame = frame_from_normal(point.ns)
        wo = to_local(frame, -ray.d)
        reflectance = row(world.reflectance, point.material)
        if depth + 1 >= max_depth:
            break
        dimension = sampling.FIRST_BOUNCE + sampling.PER_BOUNCE * depth
        u0, u1 = sobol.draw(sampler, dimension + sampling.LIGHT_POINT)
        towards = uniform_sphere(u0, u1)
        wi = to_local(frame, towards)
        if wo.z > 0.0 and wi.z > 0.0:
            f_cos = reflectance * (wi.z * INV_PI)
            if not is_black(f_cos) and _nearest(world, ray_from(point, towards)).row < 0:
                weight = power_heuristic(PDF, wi.z * INV_PI)
                total = total + throughput * (f_cos * world.sky * (weight / PDF))
        u_roulette = 0.5
        if depth + 1 >= rr_depth:
            _, u_roulette = sobol.draw(sampler, dimension + sampling.LOBE_AND_ROULETTE)
        u0, u1 = sobol.draw(sampler, dimension + sampling.BSDF_DIRECTION)
        if wo.z <= 0.0:
            break
        wi = cosine_hemisphere(u0, u1)
        bsdf_pdf = wi.z * INV_PI
        if bsdf_pdf == 0.0:
            break
        throughput = throughput * reflectance
        if depth + 1 >= rr_depth:
            survival = min(max_component(throughput), ROULETTE_CAP)
            if u_roulette >= survival:
                break
            throughput = throughput * (1.0 / survival)
        ray = ray_from(point, to_world(frame, wi))
    return total


@entry_kernel
def render_band(
    max_depth: int,
    rr_depth: int,
    world: World,
    view: PerspectiveView,
    setup: sobol.SobolSetup,
    shape: tuple[int, int],
    spp: int,
    out: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """As `reference_rt.bands.render_band`."""
    width, height = shape
    for pixel in range(begin, end):
        y, x = pixel // width, pixel % width
        total = row(out, pixel)
        for sample in range(first, last):
            sampler = sobol.start(setup, pixel, sample)
            u0, u1 = sobol.draw(sampler, sampling.FILM)
            at = (x + 0.5 + (u0 - 0.5)) / width, (y + 0.5 + (u1 - 0.5)) / height
            ray = camera_ray(view, at[0], at[1], LENS_CENTRE)
            total = total + _radiance(max_depth, rr_depth, world, ray, sampler)
        if last == spp:
            total = total / spp
        out[pixel, 0], out[pixel, 1], out[pixel, 2] = total
