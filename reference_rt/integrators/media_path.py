"""Path tracing through media: the equation of radiative transfer (Chandrasekhar 1960).

Along a ray with direction d, the radiance L changes by

    dL/dt = -sigma_t L + sigma_s integral over w of phase(w · d) L(w),

so that a path may scatter in a medium before it comes to a surface.  The distance to there is drawn
by the density sigma_t exp(-sigma_t t) of one colour, which a path has from its beginning to its
end.  Its samples are weighted for that choice by the density that the three colours have together
(multiple importance sampling by the balance heuristic; Wilkie et al. 2014, "Hero Wavelength
Spectral Sampling"): no colour is followed by a density that is far below its own, as with one
density for all colours.  Media that only absorb take their share of a path, and end none.

`ratio` is the density, up to here, that a path would have in each colour, over that in its own.
Where `path` divides a contribution by a density, here that density times the mean of `ratio` takes
its place.  Both samples of direct light, of lights and of phase functions or materials, are
combined by the power heuristic of these.

Boundaries without a surface are no edges of a path: camera rays, scattered rays and shadow rays go
on behind them, and the medium changes.
"""

import math
from typing import NamedTuple

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.geometry import closest_hit, occluded
from reference_rt.core.ray import Hit, Ray, SurfacePoint, at, ray_from
from reference_rt.core.vec3 import (
    Vec3,
    component,
    dot,
    is_black,
    length,
    max_abs,
    max_component,
    to_local,
    to_world,
)
from reference_rt.core.vec3 import row as row_of
from reference_rt.integrators.direct_light import light_selection_normal, power_heuristic
from reference_rt.integrators.path import (
    BOTH,
    BSDF_SAMPLING,
    LIGHT_SAMPLING,
    ROULETTE_CAP,
    PathSetup,
)
from reference_rt.integrators.scene_tables import KernelScene, surface
from reference_rt.integrators.shading import shade_point
from reference_rt.jit.kernel import kernel, local_floats
from reference_rt.lights import NO_LIGHT, Background, LightSample, shadow_ray
from reference_rt.materials import Scattered
from reference_rt.media.phase import BELOW_ONE, phase, turned
from reference_rt.media.tables import Media, medium_beyond, thickness
from reference_rt.sampling import Sample, draw_pair


class MediaPathSetup(NamedTuple):
    """path: that of `Path`;  media: of the scene;  camera: the number of the camera's medium."""

    path: PathSetup
    media: Media
    camera: int


_FARTHEST = 2.0**500
"""How far a path flies at most, so that distances from there can be squared.  It ends there: what
scatters in a medium without end that far away is lit by nothing."""


class Passed(NamedTuple):
    """What a ray has passed.

    all, sampled: optical thickness, in each colour, of all media and of those that scatter.
    """

    all: Vec3
    sampled: Vec3


class Flight(NamedTuple):
    """Where a ray ends that may scatter on its way.

    is_scattered: whether in a medium, else at the surface `hit`, of kind -1 for none;  ray: its
    last part, behind all boundaries without a surface;  point: of the surface, or of the medium;
    medium: in which it ends;  passed: up to there.
    """

    is_scattered: bool
    ray: Ray
    hit: Hit
    point: SurfacePoint
    medium: int
    passed: Passed


class Way(NamedTuple):
    """Whether nothing is between the ends of a shadow ray, and what it passes."""

    is_open: bool
    passed: Passed


@kernel
def _further(media: Media, medium: int, passed: Passed, t: float) -> Passed:
    """With the distance t more."""
    if medium < 0:
        return passed
    sigma = row_of(media.sigma_t, medium)
    more = Vec3(thickness(sigma.x, t), thickness(sigma.y, t), thickness(sigma.z, t))
    if media.scatters[medium] == 0:
        return Passed(passed.all + more, passed.sampled)
    return Passed(passed.all + more, passed.sampled + more)


@kernel
def _in_space(p: Vec3, d: Vec3) -> SurfacePoint:
    """A point of a medium, as rays leave it and light is sampled from it.  Its normal is of no
    use; rays leave it from p itself, since there is no surface."""
    return SurfacePoint(p, d, d, 0.0, 0, -1)


@kernel
def fly(
    scene: KernelScene, media: Media, ray: Ray, medium: int, hue: int, u: float, hides: bool
) -> Flight:
    """Follow a ray until it scatters, comes to a surface, or leaves the scene.

    hue: the colour, 0 to 2, by whose density it scatters;  u: a number from [0, 1);  hides: whether
    lamps are passed, as boundaries are.
    """
    nothing = Vec3(0.0, 0.0, 0.0)
    # The optical thickness, in the path's colour, after which it scatters.
    left = -math.log1p(-u)
    passed = Passed(nothing, nothing)
    while True:
        until = ray
        if medium >= 0 and media.scatters[medium] != 0:
            # Where it scatters, unless a surface is nearer.
            free = max(0.0, left - component(passed.sampled, hue))
            sigma = media.sigma_t[medium, hue]
            if free < thickness(sigma, ray.t_max):
                until = Ray(ray.o, ray.d, free / sigma)
        hit = closest_hit(scene.geometry, until)
        if hit.kind < 0 and until.t_max < ray.t_max:
            t = min(until.t_max, _FARTHEST)
            there = _in_space(at(ray, t), ray.d)
            return Flight(True, ray, hit, there, medium, _further(media, medium, passed, t))
        passed = _further(media, medium, passed, hit.t)
        if hit.kind < 0:
            return Flight(False, ray, hit, _in_space(ray.o, ray.d), medium, passed)
        point = surface(scene, ray, hit)
        is_passed = media.passes[point.material] != 0 or (hides and any_light.is_area(point))
        if not is_passed:
            return Flight(False, ray, hit, point, medium, passed)
        medium = medium_beyond(media, point, ray.d, medium)
        rest = ray_from(point, ray.d)
        ray = Ray(rest.o, rest.d, ray.t_max - hit.t)


@kernel
def _look(scene: KernelScene, media: Media, ray: Ray, medium: int) -> Way:
    """Follow a shadow ray, whose direction may have any length."""
    nothing = Vec3(0.0, 0.0, 0.0)
    passed, unit = Passed(nothing, nothing), length(ray.d)
    if media.any_passes == 0:  # then any surface ends it, in the medium in which it begins
        if occluded(scene.geometry, ray):
            return Way(False, passed)
        return Way(True, _further(media, medium, passed, ray.t_max * unit))
    while True:
        hit = closest_hit(scene.geometry, ray)
        passed = _further(media, medium, passed, hit.t * unit)
        if hit.kind < 0:
            return Way(True, passed)
        point = surface(scene, ray, hit)
        if media.passes[point.material] == 0:
            return Way(False, passed)
        medium = medium_beyond(media, point, ray.d, medium)
        rest = ray_from(point, ray.d)
        ray = Ray(rest.o, rest.d, ray.t_max - hit.t)


@kernel
def _left(thick: Vec3, taken: float) -> Vec3:
    """exp(taken - thick): what is left of light, over a density exp(-taken)."""
    return Vec3(math.exp(taken - thick.x), math.exp(taken - thick.y), math.exp(taken - thick.z))


@kernel
def _mean(a: Vec3) -> float:
    return (a.x + a.y + a.z) * (1.0 / 3.0)


@kernel
def _weight(path: PathSetup, strategy: int, pdf: float, other: float) -> float:
    """The MIS weight, as of `path`."""
    if path.strategy == BOTH:
        return power_heuristic(pdf, other)
    return 1.0 if path.strategy == strategy or other == 0.0 else 0.0


class Vertex(NamedTuple):
    """Where a path scatters, as its next edge needs it.

    p, normal: from which light is picked;  pdf: the density of the edge's direction, 0 for the
    camera's and for delta lobes;  mean: that of the ratio before the edge.
    """

    p: Vec3
    normal: Vec3
    pdf: float
    mean: float


@kernel
def _met(
    path: PathSetup, vertex: Vertex, ratio: Vec3, taken: float, throughput: Vec3, light: Background
) -> Vec3:
    """Emission that an edge has met, weighted.  light: its radiance, and the density of light
    samples there, per solid angle, from the vertex;  taken: the optical thickness, in the path's
    colour, of the media on the edge that scatter."""
    mean, weight = _mean(ratio), 1.0
    if vertex.pdf > 0.0:
        reached = vertex.pdf * (mean * math.exp(-taken))
        weight = _weight(path, BSDF_SAMPLING, reached, light.density * vertex.mean)
    return throughput * light.radiance * (weight / mean)


class Picked(NamedTuple):
    """A light sample, and the number and the probability of its light."""

    light: LightSample
    number: int
    probability: float


@kernel
def _light_for(scene: KernelScene, p: Vec3, n: Vec3, u: float, at: tuple[float, float]) -> Picked:
    """A light for a point, picked by u, and the sample `at` of it.  n: see `lights.pick`."""
    picked = any_light.pick(scene.lights, p, n, u)
    if picked.probability == 0.0:
        return Picked(NO_LIGHT, 0, 0.0)
    k, u0, u1 = picked.light, at[0], at[1]
    found = any_light.sample_one(scene.lights, k, scene.shapes, scene.textures, p, u0, u1)
    return Picked(found, k, picked.probability)


@kernel
def _connect(
    setup: MediaPathSetup,
    scene: KernelScene,
    point: SurfacePoint,
    medium: int,
    ratio: Vec3,
    picked: Picked,
    scattered: Scattered,
) -> Vec3:
    """What a light sample adds, over the throughput; 0 where a surface is between.  medium: in
    which its ray begins;  scattered: what the point scatters of it."""
    light = picked.light
    if is_black(scattered.value):
        return Vec3(0.0, 0.0, 0.0)
    shadow = shadow_ray(point, light)
    way = _look(scene, setup.media, shadow, medium)
    if not way.is_open:
        return Vec3(0.0, 0.0, 0.0)
    density, weight = light.pdf * picked.probability * _mean(ratio), 1.0
    if not light.is_delta:
        reached = scattered.density * _mean(ratio * _left(way.passed.sampled, 0.0))
        weight = _weight(setup.path, LIGHT_SAMPLING, density, reached)
    return scattered.value * light.radiance * _left(way.passed.all, 0.0) * (weight / density)


@kernel
def radiance(setup: MediaPathSetup, scene: KernelScene, ray: Ray, sampler: Sample) -> Vec3:
    """An unbiased estimate of the radiance along a camera ray.  Where there are no media, it has
    the bits of `simple_path.radiance`."""
    path, media, materials, lights = setup.path, setup.media, scene.materials, scene.lights
    kept, black = local_floats(any_material.scratch_floats(materials)), Vec3(0.0, 0.0, 0.0)
    total, throughput, eta = black, Vec3(1.0, 1.0, 1.0), 1.0
    ratio, hue, medium = Vec3(1.0, 1.0, 1.0), 0, setup.camera
    if media.is_grey == 0:
        # The other number of the pair that decides the first roulette.
        _, u_hue = draw_pair(sampler, sampling.ROULETTE)
        hue = min(int(3.0 * u_hue), 2)
    vertex = Vertex(ray.o, ray.d, 0.0, 1.0)
    for depth in range(path.max_depth):
        dimension = sampling.PER_BOUNCE * depth
        u_light, u_lobe = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
        hides = depth == 0 and path.hides_lamps
        flight = fly(scene, media, ray, medium, hue, u_lobe, hides)
        ray, medium, passed, point = flight.ray, flight.medium, flight.passed, flight.point
        taken = component(passed.sampled, hue)
        throughput = throughput * _left(passed.all, taken)
        ratio = ratio * _left(passed.sampled, taken)
        if flight.is_scattered:
            if max_abs(point.p) > 0.5 * _FARTHEST:
                break
            inverse = 1.0 / media.sigma_t[medium, hue]
            throughput = throughput * row_of(media.scattered, medium) * inverse
            ratio = ratio * row_of(media.sigma_t, medium) * inverse
        elif flight.hit.kind < 0:
            if hides:
                return total
            found = any_light.background_of(lights, ray.d)
            density = any_light.environment_density(lights, vertex.p, vertex.normal, found.density)
            sky = Background(found.radiance, density)
            return total + _met(path, vertex, ratio, taken, throughput, sky)
        if is_black(throughput):
            break
        at_light = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
        u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)

        if flight.is_scattered:
            if depth + 1 == path.max_depth:
                break
            picked = _light_for(scene, point.p, black, u_light, at_light)
            if picked.light.pdf > 0.0:
                value = phase(media.lobes, medium, dot(ray.d, picked.light.wi))
                scattered = Scattered(Vec3(value, value, value), value)
                added = _connect(setup, scene, point, medium, ratio, picked, scattered)
                total = total + throughput * added
            d = turned(media.lobes, medium, ray.d, u0, u1)
            vertex = Vertex(point.p, black, phase(media.lobes, medium, dot(ray.d, d)), _mean(ratio))
        else:
            if taken > 0.0:  # what is left of the number that has not scattered the path
                u_lobe = min(max(1.0 - (1.0 - u_lobe) * math.exp(taken), 0.0), BELOW_ONE)
            shading = shade_point(scene, ray, flight.hit, point, kept)
            if any_light.is_area(point):
                emitted = any_light.emitted(lights, point, shading.at, -ray.d)
                density = any_light.area_pdf(lights, scene.shapes, vertex.p, vertex.normal, point)
                lamp = Background(emitted, density)
                total = total + _met(path, vertex, ratio, taken, throughput, lamp)
            if depth + 1 == path.max_depth:
                break
            normal = light_selection_normal(scene, point)
            if any_material.is_smooth(materials, point.material):
                picked = _light_for(scene, point.p, normal, u_light, at_light)
                if picked.light.pdf > 0.0:
                    wi = picked.light.wi
                    scattered = any_material.eval_pdf(
                        materials, shading, to_local(shading.frame, wi)
                    )
                    beyond = medium_beyond(media, point, wi, medium)
                    added = _connect(setup, scene, point, beyond, ratio, picked, scattered)
                    total = total + throughput * added
            bounce = any_material.sample(materials, shading, u_lobe, u0, u1)
            if bounce.pdf == 0.0:
                break
            throughput, eta = throughput * bounce.weight, eta * bounce.eta
            d = to_world(shading.frame, bounce.wi)
            medium = medium_beyond(media, point, d, medium)
            vertex = Vertex(point.p, normal, 0.0 if bounce.is_delta else bounce.pdf, _mean(ratio))

        if depth + 1 >= path.rr_depth:
            survival = min(max_component(throughput) / _mean(ratio) * eta * eta, ROULETTE_CAP)
            u_roulette, _ = draw_pair(sampler, dimension + sampling.ROULETTE)
            if not u_roulette < survival:  # also ends what is NaN
                break
            throughput = throughput * (1.0 / survival)
        ray = ray_from(point, d)
    return total
