"""A path tracer for diffuse spheres under a white sky only: the renderer specialised by hand.

These are `reference_rt`'s kernels without everything that such a scene does not use: no optional
tables, no dispatch over shapes, materials, lights, cameras, samplers or filters, no textures, no
acceleration structure, and only those fields of rays, hits and paths that are read.  The structure
is the renderer's: blocks of paths, one path edge at a time, rays in SoA layout.  The picture is the
same bit for bit (its test); the time is the baseline of the renderer's own specialisation.
"""

from typing import NamedTuple

import numpy as np

from reference_rt import sampling
from reference_rt.cameras import LENS_CENTRE
from reference_rt.cameras.film import BoxFilter
from reference_rt.cameras.perspective import PerspectiveView, camera_ray
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import BLOCK, Hit, Ray, SurfacePoint, ray_from
from reference_rt.core.ray_block import (
    RAY_FLOATS,
    RayBlock,
    add_vector,
    put_ray,
    put_vector,
    ray_of,
    vector_of,
)
from reference_rt.core.vec3 import (
    Frame,
    Vec3,
    frame_from_normal,
    is_black,
    max_component,
    row,
    to_local,
    to_world,
)
from reference_rt.integrators import Path
from reference_rt.integrators.direct_light import power_heuristic
from reference_rt.integrators.path import ROULETTE_CAP, LightConnection
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.lights import Constant
from reference_rt.lights.emitters.constant import PDF
from reference_rt.materials import Diffuse
from reference_rt.materials.material import INV_PI
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import (
    PAIR_FLOATS,
    PAIR_INTEGERS,
    Samplers,
    Sobol,
    blocks,
    invalidate_pairs,
)
from reference_rt.sampling.blocks import BlockSample
from reference_rt.sampling.sobol import SobolSetup
from reference_rt.sampling.warp import cosine_hemisphere, uniform_sphere
from reference_rt.shapes import SPHERE, Sphere
from reference_rt.shapes.curved import sphere
from reference_rt.shapes.curved.sphere import Spheres
from reference_rt.shapes.ray_simd import begin as begin_lanes
from reference_rt.shapes.ray_simd import end as end_lanes

VECTOR_FLOATS = 3 * BLOCK
STATE_FLOATS = 4 * BLOCK


class World(NamedTuple):
    """spheres: their table;  reflectance (n, 3) of the materials;  sky: its radiance."""

    spheres: Spheres
    reflectance: FloatArray
    sky: Vec3


class Scratch(NamedTuple):
    """As `reference_rt.integrators.scratch.Scratch`;  hits: distances (BLOCK,), and the spheres
    (BLOCK,), -1 for none;  states (STATE_FLOATS,): throughput and pdf of paths."""

    rays: RayBlock
    totals: FloatArray
    shadows: RayBlock
    lights: FloatArray
    lit: IntArray
    distances: FloatArray
    hits: IntArray
    states: FloatArray
    samples: IntArray


class State(NamedTuple):
    """What a path is when it goes on: see `reference_rt.integrators.path_state.State`."""

    throughput: Vec3
    bsdf_pdf: float


class Step(NamedTuple):
    """How a path leaves a surface: see `reference_rt.integrators.path.Step`."""

    goes_on: bool
    ray: Ray
    state: State


class Shading(NamedTuple):
    """point: of a sphere;  frame: around its normal;  wo: towards the viewer, local."""

    point: SurfacePoint
    frame: Frame
    wo: Vec3


def world_of(scene: Scene) -> World:
    """The scene for these kernels.  Raises ValueError for a scene that they do not support."""
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
    spheres = geometry.shapes.spheres
    if spheres is None or geometry.bvh is not None:
        raise ValueError("expected spheres, few enough to need no acceleration structure")
    colours = [m.reflectance for m in scene.materials.values() if isinstance(m, Diffuse)]
    return World(spheres, np.array(colours), Vec3(*environment.radiance))


@kernel
def _nearest(
    spheres: Spheres, rays: RayBlock, distances: FloatArray, hits: IntArray, n: int
) -> None:
    """The nearest sphere to each of the first n rays."""
    t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
    for at in range(0, n, VECTOR_WIDTH):
        begin_lanes(rays.numbers, at, t, codes)
        for i in range(len(spheres.radius)):
            shape = (row(spheres.center, i), spheres.radius[i])
            sphere.nearer(rays.numbers, at, shape, i, t, codes)
        end_lanes(t, codes, at, distances, hits)


@kernel
def _sampler_of(samplers: Samplers, k: int) -> BlockSample:
    pixel, number = samplers.pixels[k], samplers.numbers[k]
    return blocks.start(samplers.setup, pixel, number, samplers.pairs, samplers.made)


@kernel
def _state_of(scratch: Scratch, j: int) -> State:
    return State(vector_of(scratch.states, 0, j), scratch.states[3 * BLOCK + j])


@kernel
def _put_state(scratch: Scratch, j: int, k: int, state: State) -> None:
    scratch.samples[j] = k
    put_vector(scratch.states, 0, j, state.throughput)
    scratch.states[3 * BLOCK + j] = state.bsdf_pdf


@kernel
def _next_event(
    world: World, state: State, shading: Shading, sampler: BlockSample, depth: int
) -> LightConnection:
    point = shading.point
    nothing = LightConnection(Vec3(0.0, 0.0, 0.0), Ray(point.p, point.n, 0.0))
    u0, u1 = blocks.draw(sampler, sampling.PER_BOUNCE * depth + sampling.LIGHT_POINT)
    towards = uniform_sphere(u0, u1)
    wi = to_local(shading.frame, towards)
    if shading.wo.z <= 0.0 or wi.z <= 0.0:
        return nothing
    density = wi.z * INV_PI
    weight = power_heuristic(PDF, density)
    arriving = row(world.reflectance, point.material) * density * world.sky * (weight / PDF)
    return LightConnection(state.throughput * arriving, ray_from(point, towards))


@kernel
def _scatter(
    rr_depth: int, world: World, state: State, shading: Shading, sampler: BlockSample, depth: int
) -> Step:
    point, dimension = shading.point, sampling.PER_BOUNCE * depth
    ended = Step(False, Ray(point.p, point.n, 0.0), state)
    u0, u1 = blocks.draw(sampler, dimension + sampling.BSDF_DIRECTION)
    if shading.wo.z <= 0.0:
        return ended
    wi = cosine_hemisphere(u0, u1)
    bsdf_pdf = wi.z * INV_PI
    if bsdf_pdf == 0.0:
        return ended
    throughput = state.throughput * row(world.reflectance, point.material)
    if depth + 1 >= rr_depth:
        survival = min(max_component(throughput), ROULETTE_CAP)
        u_roulette, _ = blocks.draw(sampler, dimension + sampling.ROULETTE)
        if u_roulette >= survival:
            return ended
        throughput = throughput * (1.0 / survival)
    ray = ray_from(point, to_world(shading.frame, wi))
    return Step(True, ray, State(throughput, bsdf_pdf))


@kernel
def _radiances(
    max_depth: int, rr_depth: int, world: World, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    """As `reference_rt.integrators.path.radiances`."""
    rays, shadows = scratch.rays, scratch.shadows
    for j in range(n):
        _put_state(scratch, j, j, State(Vec3(1.0, 1.0, 1.0), 0.0))
        put_vector(scratch.totals, 0, j, Vec3(0.0, 0.0, 0.0))
    for depth in range(max_depth):
        if n == 0:
            break
        _nearest(world.spheres, rays, scratch.distances, scratch.hits, n)
        alive, lit = 0, 0
        for j in range(n):
            k, t, i = scratch.samples[j], scratch.distances[j], scratch.hits[j]
            state, ray = _state_of(scratch, j), ray_of(rays, j)
            if i < 0:
                weight = 1.0
                if state.bsdf_pdf > 0.0:
                    weight = power_heuristic(state.bsdf_pdf, PDF)
                add_vector(scratch.totals, 0, k, state.throughput * world.sky * weight)
                continue
            if depth + 1 >= max_depth:
                continue
            point = sphere.surface(world.spheres, ray, Hit(t, SPHERE, i, 0.0, 0.0, -1))
            frame = frame_from_normal(point.ns)
            shading = Shading(point, frame, to_local(frame, -ray.d))
            sampler = _sampler_of(samplers, k)
            found = _next_event(world, state, shading, sampler, depth)
            if not is_black(found.light):
                put_ray(shadows, lit, found.shadow)
                put_vector(scratch.lights, 0, lit, found.light)
                scratch.lit[lit] = k
                lit += 1
            step = _scatter(rr_depth, world, state, shading, sampler, depth)
            if step.goes_on:
                put_ray(rays, alive, step.ray)
                _put_state(scratch, alive, k, step.state)
                alive += 1
        _nearest(world.spheres, shadows, scratch.distances, scratch.hits, lit)
        for j in range(lit):
            if scratch.hits[j] < 0:
                add_vector(scratch.totals, 0, scratch.lit[j], vector_of(scratch.lights, 0, j))
        n = alive


@entry_kernel
def render_tile(
    max_depth: int,
    rr_depth: int,
    world: World,
    view: PerspectiveView,
    setup: SobolSetup,
    shape: tuple[int, int],
    spp: int,
    out: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """As `reference_rt.rendering.tiles.render_tile`."""
    scratch = Scratch(
        rays=RayBlock(local_floats(RAY_FLOATS)),
        totals=local_floats(VECTOR_FLOATS),
        shadows=RayBlock(local_floats(RAY_FLOATS)),
        lights=local_floats(VECTOR_FLOATS),
        lit=local_integers(BLOCK),
        distances=local_floats(BLOCK),
        hits=local_integers(BLOCK),
        states=local_floats(STATE_FLOATS),
        samples=local_integers(BLOCK),
    )
    pixels, numbers = local_integers(BLOCK), local_integers(BLOCK)
    pairs, made = local_floats(PAIR_FLOATS), local_integers(PAIR_INTEGERS)
    samplers = Samplers(setup, pixels, numbers, pairs, made)
    for k in range(RAY_FLOATS):  # see `reference_rt.integrators.scratch.prepare`
        scratch.rays.numbers[k] = scratch.shadows.numbers[k] = 1.0
    invalidate_pairs(samplers)
    width, height = shape
    count = last - first
    paths = (end - begin) * count
    for start in range(0, paths, BLOCK):
        n = min(BLOCK, paths - start)
        for k in range(n):
            pixel = begin + (start + k) // count
            pixels[k], numbers[k] = pixel, first + (start + k) % count
            y, x = pixel // width, pixel % width
            u0, u1 = blocks.draw(_sampler_of(samplers, k), sampling.FILM)
            at = (x + 0.5 + (u0 - 0.5)) / width, (y + 0.5 + (u1 - 0.5)) / height
            put_ray(scratch.rays, k, camera_ray(view, at[0], at[1], LENS_CENTRE))
        _radiances(max_depth, rr_depth, world, samplers, n, scratch)
        for k in range(n):
            pixel = pixels[k]
            total = row(out, pixel) + vector_of(scratch.totals, 0, k)
            if numbers[k] + 1 == spp:
                total = total / spp
            out[pixel, 0], out[pixel, 1], out[pixel, 2] = total
