"""Direct illumination: emission, and light that one surface scatters towards the camera.

L = L_e + the integral of f |cos| L_e over directions, estimated at the first hit by n light samples
and m BSDF samples with multiple importance sampling (`path` says which integral each one is).

On a `grid`, which has no random numbers, the integral is a sum over all lights.  It is exact, for
the scene is then checked to have no lights but points and directions, which no BSDF sample finds.
"""

from typing import Annotated, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.block_query import closest_hits
from reference_rt.core.model import Description, Examples
from reference_rt.core.ray import (
    BLOCK,
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    HitBlock,
    Ray,
    RayBlock,
    add_vector,
    hit_of,
    put_ray,
    put_vector,
    ray_of,
)
from reference_rt.core.vec3 import Vec3, is_black, to_local, to_world
from reference_rt.integrators.direct_light import (
    light_selection_normal,
    pass_lamps,
    power_heuristic,
)
from reference_rt.integrators.path import (
    LIGHT_SAMPLING,
    UNLIMITED,
    LightConnection,
    Path,
    PathSetup,
    Scratch,
    State,
    Step,
    add_unoccluded,
    connect,
    environment_emission,
    go_on,
    hit_emission,
    mis_weights,
    prepare,
    put_state,
    state_of,
)
from reference_rt.integrators.scene_tables import KernelScene, surface
from reference_rt.integrators.shading import shade, shade_point
from reference_rt.jit.kernel import ByClass, kernel, local_floats, local_integers
from reference_rt.lights import LightSample, Pick, background_of
from reference_rt.materials import BsdfSample, Scattered, Shading
from reference_rt.sampling import Sample, Samplers, draw_pair, sampler_of, split_sample
from reference_rt.sampling.blocks import BlockSample
from reference_rt.sampling.grid import GridSample
from reference_rt.sampling.independent import IndependentSample
from reference_rt.sampling.sobol import SobolSample

_Count = Annotated[int, Field(ge=0, le=1024)]


class Direct(Description):
    """Emission, and light that is scattered once, by sampling lights and materials with multiple
    importance sampling."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"light_samples": 2, "bsdf_samples": 3, "hide_emitters": True},
        {"shadows": False},
    )
    deterministic: ClassVar[bool] = False
    type: Literal["direct"] = "direct"
    light_samples: _Count = 1
    """Samples of lights for each camera ray, from 0 to 1024.  With 0, light of points and
    directions is missing."""
    bsdf_samples: _Count = 1
    """Directions that are sampled from the material for each camera ray, from 0 to 1024."""
    hide_emitters: bool = False
    """Whether lamps are not seen directly, and the background is black: camera rays pass through
    surfaces that emit.  Their light, mirrors that show them, and `layers` do not change."""
    shadows: bool = True
    """Whether surfaces block light.  Without shadows, as in rasterisers that compute none,
    directions are not sampled from materials, so that mirrors are black."""

    @model_validator(mode="after")
    def _any(self) -> Self:
        if not self.shadows and self.light_samples == 0:
            raise ValueError("no shadows and no samples of lights; expected light_samples above 0")
        if self.light_samples + self.bsdf_samples == 0:
            raise ValueError("no samples at all; expected light_samples or bsdf_samples above 0")
        return self

    @property
    def follows_scattered(self) -> bool:
        """Whether BSDF-sampled rays collect emission that light sampling can sample, too."""
        return self.shadows and self.bsdf_samples > 0

    def as_path(self) -> PathSetup | None:
        """The path tracer that draws the same samples of the same numbers, with the same bits, or
        None: with one sample of each kind, paths of two edges.  It takes 0.97 to 1.01 of the time
        (measured on three scenes), and its kernels are compiled for paths anyway."""
        if self.light_samples == self.bsdf_samples == 1 and self.shadows:
            return Path(max_depth=2, hide_emitters=self.hide_emitters).setup()
        return None

    def setup(self) -> "DirectSetup":
        bsdf_samples = self.bsdf_samples if self.shadows else 0
        return DirectSetup(self.light_samples, bsdf_samples, self.hide_emitters, self.shadows)


class DirectSetup(NamedTuple):
    """rr_depth: as in `PathSetup`, which `path.scatter` reads: no roulette."""

    light_samples: int
    bsdf_samples: int
    hides_lamps: bool
    shadows: bool
    rr_depth: int = UNLIMITED


@kernel
def _weight(direct: DirectSetup, strategy: int, pdf: float, other: float) -> float:
    n, m = float(direct.light_samples), float(direct.bsdf_samples)
    if strategy == LIGHT_SAMPLING:
        return power_heuristic(n * pdf, m * other)
    return power_heuristic(m * pdf, n * other)


mis_weights.register(DirectSetup, _weight)


class Waiting(NamedTuple):
    """How many shadow rays and scattered rays wait to be traced."""

    shadows: int
    scattered: int


@kernel
def radiances(
    direct: DirectSetup, scene: KernelScene, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    """Unbiased estimates of the radiance along the first n of `scratch.rays`, by paths of at most
    two edges, into `scratch.totals`.

    Shadow rays and scattered rays wait in `queue` until they fill a block, or all camera rays are
    shaded.  Each camera ray's terms are added in one order, whatever the others of its block:
    emission, then light samples, then BSDF samples.
    """
    queue = Scratch(
        rays=RayBlock(local_floats(RAY_FLOATS)),
        totals=scratch.totals,
        shadows=scratch.shadows,
        arriving=scratch.arriving,
        of=scratch.of,
        hits=HitBlock(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS)),
        states=scratch.states,
        samples=scratch.samples,
        kept=local_floats(any_material.scratch_floats(scene.materials)),
        points=scratch.points,
        lit=scratch.lit,
        scattered=scratch.scattered,
    )
    prepare(queue)
    rays, hits, waiting = scratch.rays, scratch.hits, Waiting(0, 0)
    if direct.hides_lamps:
        pass_lamps(scene, rays, hits, n)
    closest_hits(scene.geometry, rays, hits, n)
    for j in range(n):
        put_vector(scratch.totals, 0, j, Vec3(0.0, 0.0, 0.0))
        ray = ray_of(rays, j)
        hit = hit_of(hits, j)
        if hit.kind < 0:
            if not direct.hides_lamps:
                put_vector(scratch.totals, 0, j, any_light.background(scene.lights, ray.d))
            continue
        shading = shade(scene, ray, hit, scratch.kept)
        emitted = any_light.emitted(scene.lights, shading.point, shading.at, -ray.d)
        put_vector(scratch.totals, 0, j, emitted)
        sampler = sampler_of(samplers, j)
        waiting = _scatter_light(sampler, direct, scene, shading, j, waiting, queue)
    _trace(direct, scene, waiting, queue)


@kernel
def _part(n: int) -> State:
    """The state of a path of which one of n samples goes on."""
    share, nowhere = 1.0 / max(n, 1), Vec3(0.0, 0.0, 0.0)
    return State(Vec3(share, share, share), 1.0, 0.0, nowhere, nowhere)


@kernel
def _group(n: int) -> int:
    """The group of dimensions of n samples at the first hit: that of the camera ray for one, which
    is stratified together with it, and another for more, whose numbers are not the ray's."""
    return min(n - 1, 1)


@kernel
def _enqueue(
    direct: DirectSetup,
    scene: KernelScene,
    connection: LightConnection,
    j: int,
    n: int,
    queue: Scratch,
) -> int:
    """Add a shadow ray of camera ray j to the n that wait; how many there are then."""
    if is_black(connection.light):
        return n
    if not direct.shadows:
        add_vector(queue.totals, 0, j, connection.light)
        return n
    if n == BLOCK:
        add_unoccluded(scene, queue, n)
        n = 0
    put_ray(queue.shadows, n, connection.shadow)
    put_vector(queue.arriving, 0, n, connection.light)
    queue.of[n] = j
    return n + 1


@kernel
def _connected(
    direct: DirectSetup,
    scene: KernelScene,
    state: State,
    shading: Shading,
    light: LightSample,
    picked: Pick,
) -> LightConnection:
    """What a sample of a light adds, if nothing is between."""
    scattered = Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    if light.pdf > 0.0:
        wi = to_local(shading.frame, light.wi)
        scattered = any_material.eval_pdf(scene.materials, shading, wi)
    return connect(direct, state, shading.point, light, picked, scattered)


@kernel
def _light_sample(
    direct: DirectSetup,
    scene: KernelScene,
    state: State,
    shading: Shading,
    sampler: Sample,
    group: int,
) -> LightConnection:
    """Direct light of one randomly selected light.  Random numbers that decide nothing are not
    drawn."""
    point, dimension = shading.point, sampling.PER_BOUNCE * group
    nothing = LightConnection(Vec3(0.0, 0.0, 0.0), Ray(point.p, point.n, 0.0))
    count, u_pick = any_light.count(scene.lights), 0.5
    if count == 0 or not any_material.is_smooth(scene.materials, point.material):
        return nothing
    if count > 1:
        u_pick, _ = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    picked = any_light.pick(scene.lights, point.p, light_selection_normal(scene, point), u_pick)
    if picked.probability == 0.0:
        return nothing
    u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
    light = any_light.sample_one(
        scene.lights, picked.light, scene.shapes, scene.textures, point.p, u0, u1
    )
    return _connected(direct, scene, state, shading, light, picked)


@kernel
def _scattered(
    direct: DirectSetup,
    scene: KernelScene,
    state: State,
    shading: Shading,
    sampler: Sample,
    group: int,
) -> Step:
    """A direction that the material has drawn."""
    dimension, u_lobe = sampling.PER_BOUNCE * group, 0.5
    if any_material.uses_u_lobe(scene.materials, shading.point.material):
        _, u_lobe = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
    drawn = any_material.sample(scene.materials, shading, u_lobe, u0, u1)
    wi = to_world(shading.frame, drawn.wi)
    drawn = BsdfSample(wi, drawn.weight, drawn.pdf, drawn.eta, drawn.is_delta)
    return go_on(direct, scene, state, shading.point, drawn, sampler, group)


@kernel
def _of_samples(
    sampler: Sample,
    direct: DirectSetup,
    scene: KernelScene,
    shading: Shading,
    j: int,
    waiting: Waiting,
    queue: Scratch,
) -> Waiting:
    """Samples of lights and of the material at the first hit of camera ray j."""
    shadows, scattered = waiting
    n = direct.light_samples
    state, group = _part(n), _group(n)
    for k in range(n):
        part = split_sample(sampler, n, k)
        connection = _light_sample(direct, scene, state, shading, part, group)
        shadows = _enqueue(direct, scene, connection, j, shadows, queue)
    n = direct.bsdf_samples
    state, group = _part(n), _group(n)
    for k in range(n):
        step = _scattered(direct, scene, state, shading, split_sample(sampler, n, k), group)
        if not step.goes_on:
            continue
        if scattered == BLOCK:
            _trace(direct, scene, Waiting(shadows, scattered), queue)
            shadows, scattered = 0, 0
        put_ray(queue.rays, scattered, step.ray)
        put_state(queue, scattered, j, step.state)
        scattered += 1
    return Waiting(shadows, scattered)


@kernel
def _of_all_lights(
    sampler: GridSample,
    direct: DirectSetup,
    scene: KernelScene,
    shading: Shading,
    j: int,
    waiting: Waiting,
    queue: Scratch,
) -> Waiting:
    """The same without random numbers: light of every point and direction."""
    if direct.light_samples == 0:
        return waiting
    if not any_material.is_smooth(scene.materials, shading.point.material):
        return waiting
    shadows, shapes, p = waiting.shadows, scene.shapes, shading.point.p
    for k in range(any_light.count(scene.lights)):
        light = any_light.sample_one(scene.lights, k, shapes, scene.textures, p, 0.5, 0.5)
        connection = _connected(direct, scene, _part(1), shading, light, Pick(k, 1.0))
        shadows = _enqueue(direct, scene, connection, j, shadows, queue)
    return Waiting(shadows, waiting.scattered)


_choice = ByClass("scatter_light")
for _sample in (SobolSample, BlockSample, IndependentSample):
    _choice.register(_sample, _of_samples)
_choice.register(GridSample, _of_all_lights)
_scatter_light = _choice.function


@kernel
def _trace(direct: DirectSetup, scene: KernelScene, waiting: Waiting, queue: Scratch) -> None:
    """Add the light of all shadow rays that wait, then the emission that scattered rays meet."""
    add_unoccluded(scene, queue, waiting.shadows)
    rays, hits = queue.rays, queue.hits
    closest_hits(scene.geometry, rays, hits, waiting.scattered)
    for k in range(waiting.scattered):
        state, ray, j = state_of(queue, k), ray_of(rays, k), queue.samples[k]
        hit = hit_of(hits, k)
        if hit.kind < 0:
            background = background_of(scene.lights, ray.d)
            add_vector(queue.totals, 0, j, environment_emission(direct, scene, state, background))
            continue
        point = surface(scene, ray, hit)
        if any_light.is_area(point):
            at = shade_point(scene, ray, hit, point, queue.kept).at
            add_vector(queue.totals, 0, j, hit_emission(direct, scene, state, ray, point, at))
