"""Path tracing: a Monte Carlo estimate of the rendering equation (Kajiya 1986).

The radiance that leaves a surface point x in direction w_o is

    L(x, w_o) = L_e(x, w_o) + integral over w_i of f(x, w_i, w_o) |cos w_i| L(y, -w_i),

where y is what the ray from x along w_i hits first.  A path estimates the integral with one random
direction at each surface.  Its throughput is the product of f |cos| / pdf along the way.  Each edge
of the path takes three steps:

1. `environment_emission` or `hit_emission`: throughput times L_e of what the ray has hit.
2. `next_event_estimation`: throughput f |cos| L_e / pdf of one sampled point on a light, if its
   shadow ray is not occluded.
3. `scatter`: the BSDF samples the next direction; Russian roulette may end the path.

Step 2 and the next edge's step 1 estimate the same direct light.  `mis_weights` weight them so
that it is counted once (multiple importance sampling, Veach 1997).

`_edge` takes these steps.  `radiances` does so for a block of paths, edge by edge, so that the rays
of all paths are traced together.
"""

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.block_query import any_hits, closest_hits, hit_of
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Description, Examples
from reference_rt.core.ray import (
    BLOCK,
    RAY_FLOATS,
    Hit,
    HitBlock,
    Ray,
    RayBlock,
    add_vector,
    put_ray,
    put_vector,
    ray_from,
    ray_of,
    vector_of,
)
from reference_rt.core.vec3 import Vec3, is_black, max_component, to_world
from reference_rt.integrators.direct_light import (
    light_selection_normal,
    pass_lamps,
    power_heuristic,
    unshadowed,
)
from reference_rt.integrators.look_ahead import look_ahead
from reference_rt.integrators.scene_tables import SceneTables, shapes_of, surface
from reference_rt.integrators.shading import shade_point
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.lights import Ahead, LightSample, Pick, shadow_ray
from reference_rt.materials import Shading
from reference_rt.sampling import Sample, Samplers, draw_pair, sampler_of

STATE_FLOATS = 11 * BLOCK
VECTOR_FLOATS = 3 * BLOCK


class Scratch(NamedTuple):
    """rays: input, the camera rays; integrators overwrite them;  totals (VECTOR_FLOATS,): output,
    the radiance along each camera ray.

    Buffers of integrators: shadows, the shadow rays; for each of them lights (VECTOR_FLOATS,), what
    it adds if it is not occluded, and lit (BLOCK,), the sample that it belongs to;  hits;  states
    (STATE_FLOATS,) of the active paths and samples (BLOCK,), the sample of each;  kept
    (`materials.scratch_floats`,), the buffer of `shade`;  sky (AHEAD_FLOATS,): light of an
    environment map, see `look_ahead`; of length 0 without one.
    """

    rays: RayBlock
    totals: FloatArray
    shadows: RayBlock
    lights: FloatArray
    lit: IntArray
    hits: HitBlock
    states: FloatArray
    samples: IntArray
    kept: FloatArray
    sky: FloatArray


@kernel
def prepare(scratch: Scratch) -> None:
    """Initialise the rays.  Vector lanes without a ray are traced too, and uninitialised memory may
    hold subnormal numbers, on which some processors are a hundred times slower."""
    for k in range(RAY_FLOATS):
        scratch.rays.numbers[k] = 1.0
        scratch.shadows.numbers[k] = 1.0
    for k in range(len(scratch.sky)):
        scratch.sky[k] = 0.0


class State(NamedTuple):
    """The state of a path along its current ray.

    throughput: product of f |cos| / pdf so far;  eta: product of the relative indices of the media
    it has entered;  bsdf_pdf: solid-angle density of the ray's direction, 0 for camera rays and
    delta lobes, whose MIS weight is 1;  previous, normal: the vertex that the ray left and its
    `light_selection_normal`, from which the light sampler's density is evaluated.
    """

    throughput: Vec3
    eta: float
    bsdf_pdf: float
    previous: Vec3
    normal: Vec3


@kernel
def start(ray: Ray) -> State:
    """The state of a camera ray."""
    return State(Vec3(1.0, 1.0, 1.0), 1.0, 0.0, ray.o, ray.d)


@kernel
def state_of(scene: SceneTables, scratch: Scratch, j: int) -> State:
    """The state of active path j."""
    numbers, nowhere = scratch.states, Vec3(0.0, 0.0, 0.0)
    eta = numbers[4 * BLOCK + j] if any_material.any_transmits(scene.materials) else 1.0
    previous = vector_of(numbers, 5, j) if any_light.depends_on_point(scene.lights) else nowhere
    normal = vector_of(numbers, 8, j) if any_light.depends_on_normal(scene.lights) else nowhere
    return State(vector_of(numbers, 0, j), eta, numbers[3 * BLOCK + j], previous, normal)


@kernel
def put_state(scene: SceneTables, scratch: Scratch, j: int, k: int, state: State) -> None:
    """Store the state of sample k's path as active path j.  Fields that this scene's kernels never
    read are not stored (measured: storing all takes 3 % longer for spheres under a sky)."""
    scratch.samples[j] = k
    numbers = scratch.states
    put_vector(numbers, 0, j, state.throughput)
    numbers[3 * BLOCK + j] = state.bsdf_pdf
    if any_material.any_transmits(scene.materials):
        numbers[4 * BLOCK + j] = state.eta
    if any_light.depends_on_point(scene.lights):
        put_vector(numbers, 5, j, state.previous)
    if any_light.depends_on_normal(scene.lights):
        put_vector(numbers, 8, j, state.normal)


UNLIMITED = 2**31
ROULETTE_CAP = 0.999
"""The highest survival probability of Russian roulette: below 1, so that paths between perfect
mirrors end.

Where the albedo exceeds the cap, a path's weight grows by albedo / cap per bounce, and its variance
is infinite from albedo² = cap on.  Mitsuba's cap of 0.95 reaches that at an albedo of 0.975.  The
mean does not depend on the cap.
"""

LIGHT_SAMPLING, BSDF_SAMPLING, _BOTH = range(3)
_STRATEGIES = {"lights": LIGHT_SAMPLING, "bsdf": BSDF_SAMPLING}


class Path(Description):
    """Path tracing: unbiased global illumination by light sampling, BSDF sampling and Russian
    roulette."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"max_depth": 3, "rr_depth": 2, "hide_emitters": True},
        {"sampling": "lights"},
        {"sampling": "bsdf"},
    )
    deterministic: ClassVar[bool] = False
    type: Literal["path"] = "path"
    max_depth: Annotated[int, Field(ge=0)] | None = None
    """Most edges of a path, counted from the camera: 1 shows emission alone, 2 adds direct light.
    Default: no limit."""
    rr_depth: Annotated[int, Field(ge=1, le=4096)] = 5
    """Edges after which Russian roulette may end a path, from 1 to 4096.  The mean does not depend
    on it."""
    sampling: Literal["both", "lights", "bsdf"] = "both"
    """How direct light is sampled: `lights` samples lights, `bsdf` samples materials, `both`
    combines them by multiple importance sampling.  The mean is the same.  Light that only one
    strategy can sample is always sampled by that one."""
    hide_emitters: bool = False
    """Whether lamps are not seen directly, and the background is black: camera rays pass through
    surfaces that emit.  Their light, mirrors that show them, and `layers` do not change."""

    @property
    def follows_scattered(self) -> bool:
        """Whether BSDF-sampled rays collect emission that light sampling can sample, too."""
        return self.sampling != "lights"

    def setup(self) -> "PathSetup":
        limit = UNLIMITED if self.max_depth is None else min(self.max_depth, UNLIMITED)
        strategy = _STRATEGIES.get(self.sampling)
        return PathSetup(limit, self.rr_depth, strategy, self.hide_emitters)


class PathSetup(NamedTuple):
    """strategy: the only sampling strategy for direct light, `LIGHT_SAMPLING` or `BSDF_SAMPLING`;
    None for both with multiple importance sampling, which compiles to no branch;  `_BOTH` for both
    in kernels that do not depend on it;  hides_lamps: see `Path.hide_emitters`."""

    max_depth: int
    rr_depth: int
    strategy: int | None
    hides_lamps: bool

    def linked(self) -> "PathSetup":
        """The same for linked kernels: of one type for all strategies."""
        return self._replace(strategy=_BOTH) if self.strategy is None else self


class Step(NamedTuple):
    """A path after scattering.  goes_on: whether it continues, along `ray` with `state`."""

    goes_on: bool
    ray: Ray
    state: State


class LightConnection(NamedTuple):
    """Next-event estimation before its visibility test.  light: what it adds to the path's
    radiance, weight included, if the ray `shadow` is not occluded; 0 for no contribution."""

    light: Vec3
    shadow: Ray


class Edge(NamedTuple):
    """An edge of a path.  emitted: what it adds to the path's radiance by emission of what it has
    hit;  connection: by next-event estimation there;  step: how the path goes on."""

    emitted: Vec3
    connection: LightConnection
    step: Step


@kernel
def _edge(
    path: PathSetup,
    scene: SceneTables,
    state: State,
    ray: Ray,
    hit: Hit,
    sampler: Sample,
    depth: int,
    kept: FloatArray,
    ahead: Ahead | None,
) -> Edge:
    """Edge number `depth`, along `ray`, which has hit `hit`.  kept: the buffer of `shade`;  ahead:
    light of an environment map that was computed ahead."""
    nothing = Vec3(0.0, 0.0, 0.0)
    unlit, ended = LightConnection(nothing, ray), Step(False, ray, state)
    if hit.kind < 0:
        if depth == 0 and path.hides_lamps:
            return Edge(nothing, unlit, ended)
        return Edge(environment_emission(path, scene, state, ray, ahead), unlit, ended)
    point = surface(scene, ray, hit)
    is_last, emits = depth + 1 >= path.max_depth, any_light.is_area(scene.lights, point)
    if is_last and not emits:
        return Edge(nothing, unlit, ended)
    shading = shade_point(scene, ray, hit, point, kept)
    emitted = nothing
    if emits:
        emitted = hit_emission(path, scene, state, ray, shading)
    if is_last:
        return Edge(emitted, unlit, ended)
    connection = next_event_estimation(path, scene, state, shading, sampler, depth, ahead)
    return Edge(emitted, connection, scatter(path, scene, state, shading, sampler, depth))


@kernel
def radiances(
    path: PathSetup, scene: SceneTables, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    """Unbiased estimates of the radiance that arrives at the origins of the first n of
    `scratch.rays` from their directions, one path each, into `scratch.totals`.

    Ended paths are removed: number j of the active paths belongs to sample `scratch.samples[j]`.
    The other paths of a block do not change a path's bits.
    """
    rays, shadows, hits, lights = scratch.rays, scratch.shadows, scratch.hits, scene.lights
    sky = any_light.map_of(lights)
    if path.hides_lamps:
        pass_lamps(scene, rays, hits, n)
    for j in range(n):
        put_state(scene, scratch, j, j, start(ray_of(rays, j)))
        put_vector(scratch.totals, 0, j, Vec3(0.0, 0.0, 0.0))
    for depth in range(path.max_depth):
        if n == 0:
            break
        closest_hits(scene.geometry, rays, hits, n)
        is_last, samples = depth + 1 >= path.max_depth, scratch.samples
        look_ahead(sky, samplers, samples, depth, is_last, rays, hits, n, scratch.sky)
        alive, lit = 0, 0
        for j in range(n):
            k = scratch.samples[j]
            state, ray = state_of(scene, scratch, j), ray_of(rays, j)
            hit, sampler = hit_of(scene.geometry, ray, hits, j), sampler_of(samplers, k)
            ahead = any_light.ahead_of(lights, scratch.sky, j)
            edge = _edge(path, scene, state, ray, hit, sampler, depth, scratch.kept, ahead)
            add_vector(scratch.totals, 0, k, edge.emitted)
            if not is_black(edge.connection.light):
                put_ray(shadows, lit, edge.connection.shadow)
                put_vector(scratch.lights, 0, lit, edge.connection.light)
                scratch.lit[lit] = k
                lit += 1
            if edge.step.goes_on:
                put_ray(rays, alive, edge.step.ray)
                put_state(scene, scratch, alive, k, edge.step.state)
                alive += 1
        add_unoccluded(scene, scratch, lit)
        n = alive


@kernel
def add_unoccluded(scene: SceneTables, scratch: Scratch, n: int) -> None:
    """Add the lights of the first n shadow rays that are not occluded."""
    any_hits(scene.geometry, scratch.shadows, scratch.hits, n)
    for j in range(n):
        if scratch.hits.codes[j] < 0:
            add_vector(scratch.totals, 0, scratch.lit[j], vector_of(scratch.lights, 0, j))


@kernel
def environment_emission(
    setup: Any, scene: SceneTables, state: State, ray: Ray, ahead: Ahead | None
) -> Vec3:
    """Emission of the environment along a ray that hits nothing: throughput L_e, MIS-weighted."""
    lights, weight = scene.lights, 1.0
    emitted = any_light.background_of(ahead, lights, ray.d)
    if state.bsdf_pdf > 0.0:
        light_pdf = any_light.environment_pdf(ahead, lights, state.previous, state.normal, ray.d)
        weight = _mis_weight(setup, BSDF_SAMPLING, state.bsdf_pdf, light_pdf)
    return state.throughput * emitted * weight


@kernel
def hit_emission(setup: Any, scene: SceneTables, state: State, ray: Ray, shading: Shading) -> Vec3:
    """Emission of the area light that the ray has hit: throughput L_e, MIS-weighted."""
    lights, point, weight = scene.lights, shading.point, 1.0
    if state.bsdf_pdf > 0.0:
        shapes = shapes_of(scene)
        light_pdf = any_light.area_pdf(lights, shapes, state.previous, state.normal, point)
        weight = _mis_weight(setup, BSDF_SAMPLING, state.bsdf_pdf, light_pdf)
    return state.throughput * any_light.emitted(lights, point, shading.at, -ray.d) * weight


@kernel
def _weight_of(only: int | None, strategy: int, pdf: float, other: float) -> float:
    """With the single strategy `only`, samples of the other count nothing, except where the single
    one cannot draw them (other = 0)."""
    if only is None:
        return power_heuristic(pdf, other)
    if only == _BOTH:
        return power_heuristic(pdf, other)
    return 1.0 if only == strategy or other == 0.0 else 0.0


@kernel
def _weight_of_path(path: PathSetup, strategy: int, pdf: float, other: float) -> float:
    return _weight_of(path.strategy, strategy, pdf, other)


mis_weights = ByClass("mis_weight")
"""By the class of an integrator's setup: mis_weight(setup, strategy, pdf, other) is the weight of a
sample that `strategy` drew with density `pdf`, and the other strategy would draw with density
`other`."""
mis_weights.register(PathSetup, _weight_of_path)
_mis_weight = mis_weights.function


@kernel
def next_event_estimation(
    setup: Any,
    scene: SceneTables,
    state: State,
    shading: Shading,
    sampler: Sample,
    depth: int,
    ahead: Ahead | None,
) -> LightConnection:
    """Direct light of one randomly selected light: throughput f |cos| L_e / pdf, MIS-weighted
    against BSDF sampling.  Random numbers that decide nothing are not drawn."""
    point, dimension = shading.point, sampling.PER_BOUNCE * depth
    nothing = LightConnection(Vec3(0.0, 0.0, 0.0), Ray(point.p, point.n, 0.0))
    count = any_light.count(scene.lights)
    if count == 0 or not any_material.is_smooth(scene.materials, point.material):
        return nothing
    u_pick = 0.5
    if count > 1:
        u_pick, _ = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    picked = any_light.pick(scene.lights, point.p, light_selection_normal(scene, shading), u_pick)
    if picked.probability == 0.0:
        return nothing
    u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
    shapes, textures = shapes_of(scene), scene.textures
    light = any_light.sample_picked(
        ahead, scene.lights, picked.light, shapes, textures, point.p, u0, u1
    )
    return connect(setup, scene, state, shading, light, picked)


@kernel
def connect(
    setup: Any,
    scene: SceneTables,
    state: State,
    shading: Shading,
    light: LightSample,
    picked: Pick,
) -> LightConnection:
    """What a sample of the light that was picked adds, if nothing is between."""
    sample = unshadowed(scene, shading, light)
    if is_black(sample.contribution):
        return LightConnection(sample.contribution, Ray(shading.point.p, shading.point.n, 0.0))
    pdf = light.pdf * picked.probability
    weight = 1.0
    if not light.is_delta:
        weight = _mis_weight(setup, LIGHT_SAMPLING, pdf, sample.bsdf_pdf)
    arriving = sample.contribution * (weight / pdf)
    return LightConnection(state.throughput * arriving, shadow_ray(shading.point, light))


@kernel
def scatter(
    setup: Any, scene: SceneTables, state: State, shading: Shading, sampler: Sample, depth: int
) -> Step:
    """Sample the BSDF at the surface that edge number `depth` has hit; apply Russian roulette."""
    point, dimension = shading.point, sampling.PER_BOUNCE * depth
    ended = Step(False, Ray(point.p, point.n, 0.0), state)
    u_lobe = 0.5
    if any_material.uses_u_lobe(scene.materials, point.material):
        _, u_lobe = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
    scattered = any_material.sample(scene.materials, shading, u_lobe, u0, u1)
    if scattered.pdf == 0.0:
        return ended
    throughput = state.throughput * scattered.weight
    eta = state.eta * scattered.eta
    if depth + 1 >= setup.rr_depth:
        # Radiance changes by 1 / eta² on entering a medium.  eta² undoes that: survival depends on
        # the power that is left.
        survival = min(max_component(throughput) * eta * eta, ROULETTE_CAP)
        u_roulette, _ = draw_pair(sampler, dimension + sampling.ROULETTE)
        if not u_roulette < survival:  # also ends what is NaN
            return ended
        throughput = throughput * (1.0 / survival)
    bsdf_pdf = 0.0 if scattered.is_delta else scattered.pdf
    ray = ray_from(point, to_world(shading.frame, scattered.wi))
    normal = light_selection_normal(scene, shading)
    return Step(True, ray, State(throughput, eta, bsdf_pdf, point.p, normal))
