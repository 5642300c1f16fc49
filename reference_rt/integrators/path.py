"""Path tracing: a Monte Carlo estimate of the rendering equation (Kajiya 1986).

The radiance that leaves a surface point x in direction w_o is

    L(x, w_o) = L_e(x, w_o) + integral over w_i of f(x, w_i, w_o) |cos w_i| L(y, -w_i),

where y is what the ray from x along w_i hits first.  A path estimates the integral with one random
direction at each surface.  Its throughput is the product of f |cos| / pdf along the way.  Each edge
of the path takes three steps:

1. `environment_emission` or `hit_emission`: throughput times L_e of what the ray has hit.
2. `connect`: throughput f |cos| L_e / pdf of one sampled point on a light, if its shadow ray is not
   occluded.
3. `go_on`: along the next direction, which the BSDF samples; Russian roulette may end the path.

Step 2 and the next edge's step 1 estimate the same direct light.  `mis_weights` weight them so
that it is counted once (multiple importance sampling, Veach 1997).

`radiances` traces a block of paths, edge by edge, and each edge in stages (Laine, Karras & Aila
2013, "Megakernels Considered Harmful"): of all paths the hits, then the surface points, the light
samples, what the materials scatter.  A stage is one kernel for each type of shape, light or
material, which is called for the block, so that it is compiled once for all scenes, and costs a
call for 64 paths.  What passes on is in `Scratch`.  simple_path.py has the same as one loop.
"""

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.block_query import any_hits, closest_hits
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Description, Examples
from reference_rt.core.ray import (
    BLOCK,
    RAY_FLOATS,
    HitBlock,
    PointBlock,
    Ray,
    RayBlock,
    SurfacePoint,
    add_vector,
    hit_of,
    point_of,
    put_ray,
    put_vector,
    ray_from,
    ray_of,
    vector_of,
)
from reference_rt.core.vec3 import Vec3, is_black, max_component, to_local
from reference_rt.integrators.direct_light import (
    light_selection_normal,
    pass_lamps,
    power_heuristic,
)
from reference_rt.integrators.scene_tables import KernelScene, surfaces
from reference_rt.integrators.shading import frame_at, place, shade_towards
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.lights import (
    Background,
    LightBlock,
    LightSample,
    Pick,
    ask_for_light,
    ask_for_no_light,
    background_in,
    light_of,
    picked_in,
    shadow_ray,
)
from reference_rt.materials import (
    Asked,
    BsdfSample,
    ScatterBlock,
    Scattered,
    asked_in,
    direction_towards,
    drawn_in,
    lit_in,
    put_asked,
    put_place,
    put_scattered,
)
from reference_rt.materials.textured import evaluate_textures
from reference_rt.sampling import Sample, Samplers, draw_pair, sampler_of
from reference_rt.textures import At

STATE_FLOATS, VECTOR_FLOATS = 11 * BLOCK, 3 * BLOCK


class Scratch(NamedTuple):
    """rays: input, the camera rays; integrators overwrite them;  totals (VECTOR_FLOATS,): output,
    the radiance along each camera ray.

    Buffers of integrators: shadows, the shadow rays; for each of them arriving (VECTOR_FLOATS,),
    what it adds if it is not occluded, and of (BLOCK,), the sample that it belongs to;  hits;
    states (STATE_FLOATS,) of the active paths and samples (BLOCK,), the sample of each;  kept
    (`materials.scratch_floats`,), the buffer of `shade`;  points, lit, scattered: of the active
    paths the surface points, light samples, and what the materials scatter.
    """

    rays: RayBlock
    totals: FloatArray
    shadows: RayBlock
    arriving: FloatArray
    of: IntArray
    hits: HitBlock
    states: FloatArray
    samples: IntArray
    kept: FloatArray
    points: PointBlock
    lit: LightBlock
    scattered: ScatterBlock


@kernel
def prepare(scratch: Scratch) -> None:
    """Initialise the rays.  Vector lanes without a ray are traced too, and uninitialised memory may
    hold subnormal numbers, on which some processors are a hundred times slower."""
    for k in range(RAY_FLOATS):
        scratch.rays.numbers[k] = 1.0
        scratch.shadows.numbers[k] = 1.0


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
def state_of(scratch: Scratch, j: int) -> State:
    """The state of active path j."""
    numbers = scratch.states
    bsdf_pdf, eta = numbers[3 * BLOCK + j], numbers[4 * BLOCK + j]
    previous, normal = vector_of(numbers, 5, j), vector_of(numbers, 8, j)
    return State(vector_of(numbers, 0, j), eta, bsdf_pdf, previous, normal)


@kernel
def put_state(scratch: Scratch, j: int, k: int, state: State) -> None:
    """Store the state of sample k's path as active path j."""
    scratch.samples[j] = k
    numbers = scratch.states
    put_vector(numbers, 0, j, state.throughput)
    numbers[3 * BLOCK + j], numbers[4 * BLOCK + j] = state.bsdf_pdf, state.eta
    put_vector(numbers, 5, j, state.previous)
    put_vector(numbers, 8, j, state.normal)


UNLIMITED = 2**31
ROULETTE_CAP = 0.999
"""The highest survival probability of Russian roulette: below 1, so that paths between perfect
mirrors end.

Where the albedo exceeds the cap, a path's weight grows by albedo / cap per bounce, and its variance
is infinite from albedo² = cap on.  Mitsuba's cap of 0.95 reaches that at an albedo of 0.975.  The
mean does not depend on the cap.
"""

LIGHT_SAMPLING, BSDF_SAMPLING, BOTH = range(3)
_STRATEGIES = {"lights": LIGHT_SAMPLING, "bsdf": BSDF_SAMPLING, "both": BOTH}


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
        strategy = _STRATEGIES[self.sampling]
        return PathSetup(limit, self.rr_depth, strategy, self.hide_emitters)


class PathSetup(NamedTuple):
    """strategy: the only sampling strategy for direct light, `LIGHT_SAMPLING` or `BSDF_SAMPLING`,
    or both with multiple importance sampling;  hides_lamps: see `Path.hide_emitters`."""

    max_depth: int
    rr_depth: int
    strategy: int
    hides_lamps: bool


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


@kernel
def radiances(
    path: PathSetup, scene: KernelScene, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    """Unbiased estimates of the radiance that arrives at the origins of the first n of
    `scratch.rays` from their directions, one path each, into `scratch.totals`.

    Ended paths are removed: number j of the active paths belongs to sample `scratch.samples[j]`.
    The other paths of a block do not change a path's bits.
    """
    if path.hides_lamps:
        pass_lamps(scene, scratch.rays, scratch.hits, n)
    begin(n, scratch)
    advance(path, scene, samplers, 0, n, scratch)


@kernel
def begin(n: int, scratch: Scratch) -> None:
    for j in range(n):
        put_state(scratch, j, j, start(ray_of(scratch.rays, j)))
        put_vector(scratch.totals, 0, j, Vec3(0.0, 0.0, 0.0))


@kernel
def advance(
    path: PathSetup, scene: KernelScene, samplers: Samplers, first: int, n: int, scratch: Scratch
) -> None:
    """Trace the n active paths from edge number `first` to their ends."""
    points, lit = scratch.points, scratch.lit
    for depth in range(first, path.max_depth):
        if n == 0:
            break
        meet(path, scene, depth, n, scratch)
        if depth + 1 >= path.max_depth:
            break
        ask(scene, samplers, depth, n, scratch)
        any_light.sample_asked(scene.lights, lit, scene.shapes, scene.textures, points, n)
        scatter(scene, n, scratch, scratch.rays)
        n = next_edges(path, scene, samplers, depth, n, scratch)


@kernel
def meet(path: PathSetup, scene: KernelScene, depth: int, n: int, scratch: Scratch) -> None:
    """What the n active rays hit, and the emission that they meet."""
    closest_hits(scene.geometry, scratch.rays, scratch.hits, n)
    surfaces(scene, scratch.rays, scratch.hits, n, scratch.points)
    any_light.backgrounds(scene.lights, scratch.rays, scratch.hits, n, scratch.lit)
    _emission(path, scene, depth, n, scratch)


@kernel
def _emission(path: PathSetup, scene: KernelScene, depth: int, n: int, scratch: Scratch) -> None:
    """Adds the emission that the rays of the active paths have met."""
    rays, hits, totals = scratch.rays, scratch.hits, scratch.totals
    for j in range(n):
        if hits.codes[j] < 0:
            if depth > 0 or not path.hides_lamps:
                state, background = state_of(scratch, j), background_in(scratch.lit, j)
                emitted = environment_emission(path, scene, state, background)
                add_vector(totals, 0, scratch.samples[j], emitted)
        elif scratch.points.codes[BLOCK + j] >= 0:
            ray, point = ray_of(rays, j), point_of(scratch.points, j)
            looked = place(scene, point.material, ray, hit_of(hits, j))
            textured = scene.materials.textured
            at = evaluate_textures(textured, point.material, looked, scratch.kept)
            emitted = hit_emission(path, scene, state_of(scratch, j), ray, point, at)
            add_vector(totals, 0, scratch.samples[j], emitted)


@kernel
def ask(scene: KernelScene, samplers: Samplers, depth: int, n: int, scratch: Scratch) -> None:
    """What is asked of lights and materials.  Numbers that decide nothing are not drawn."""
    materials, lights, hits = scene.materials, scene.lights, scratch.hits
    is_flattened = any_material.are_flattened(materials)
    count, dimension = any_light.count(lights), sampling.PER_BOUNCE * depth
    for j in range(n):
        ask_for_no_light(scratch.lit, j)
        scratch.scattered.codes[j] = -1
        if hits.codes[j] < 0:
            continue
        ray, point, hit = ray_of(scratch.rays, j), point_of(scratch.points, j), hit_of(hits, j)
        m, sampler = point.material, sampler_of(samplers, scratch.samples[j])
        if not (is_flattened or any_material.scatters(materials, m)):
            continue
        is_smooth, u_pick, u_lobe = any_material.is_smooth(materials, m), 0.5, 0.5
        if any_material.uses_u_lobe(materials, m) or (is_smooth and count > 1):
            u_pick, u_lobe = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
        if is_smooth:
            normal = light_selection_normal(scene, point)
            picked = any_light.pick(lights, point.p, normal, u_pick)
            if picked.probability > 0.0:
                u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
                ask_for_light(lights, scratch.lit, j, picked, u0, u1)
        u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
        frame, _ = frame_at(materials, scene.geometry, ray, hit, point)
        asked = Asked(frame, u_lobe, u0, u1)
        kind, i = (0, 0) if is_flattened else (materials.kind[m], materials.row[m])
        put_asked(scratch.scattered, j, kind, i, asked)
        if any_material.uses_textures(materials, m):
            put_place(scratch.scattered, j, place(scene, m, ray, hit))


@kernel
def scatter(scene: KernelScene, n: int, scratch: Scratch, towards: RayBlock) -> None:
    """What the materials scatter: the light samples, and the paths themselves.  towards: rays from
    the viewers, which are those of the paths but for light tracing."""
    materials, rays, hits, points = scene.materials, scratch.rays, scratch.hits, scratch.points
    block, lit = scratch.scattered, scratch.lit
    if not any_material.are_flattened(materials):
        textures, kept = scene.textures, scratch.kept
        any_material.scatter(materials, block, towards, points, lit.numbers, textures, kept, n)
        return
    for j in range(n):
        if block.codes[j] >= 0:
            point, ray, wo = point_of(points, j), ray_of(rays, j), -vector_of(towards.numbers, 3, j)
            shading = shade_towards(scene, ray, hit_of(hits, j), point, wo, scratch.kept)
            wi, sent = direction_towards(lit.numbers, j), Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
            if not is_black(wi):
                sent = any_material.eval_pdf(materials, shading, to_local(shading.frame, wi))
            u = asked_in(block, j, point.ns)
            drawn = any_material.sample(materials, shading, u.u_lobe, u.u0, u.u1)
            put_scattered(block, j, shading.frame, sent, drawn)


@kernel
def next_edges(
    path: PathSetup, scene: KernelScene, samplers: Samplers, depth: int, n: int, scratch: Scratch
) -> int:
    """Adds the light samples that are not occluded, and starts the next edges; returns how many
    paths are active then."""
    alive, waiting = 0, 0
    for j in range(n):
        if scratch.scattered.codes[j] < 0:
            continue
        k, state, point = scratch.samples[j], state_of(scratch, j), point_of(scratch.points, j)
        if scratch.lit.codes[j] >= 0:
            light, picked = light_of(scratch.lit, j), picked_in(scratch.lit, j)
            connection = connect(path, state, point, light, picked, lit_in(scratch.scattered, j))
            if not is_black(connection.light):
                put_ray(scratch.shadows, waiting, connection.shadow)
                put_vector(scratch.arriving, 0, waiting, connection.light)
                scratch.of[waiting] = k
                waiting += 1
        drawn, sampler = drawn_in(scratch.scattered, j), sampler_of(samplers, k)
        step = go_on(path, scene, state, point, drawn, sampler, depth)
        if step.goes_on:
            put_ray(scratch.rays, alive, step.ray)
            put_state(scratch, alive, k, step.state)
            alive += 1
    add_unoccluded(scene, scratch, waiting)
    return alive


@kernel
def add_unoccluded(scene: KernelScene, scratch: Scratch, n: int) -> None:
    """Add the lights of the first n shadow rays that are not occluded."""
    any_hits(scene.geometry, scratch.shadows, scratch.hits, n)
    for j in range(n):
        if scratch.hits.codes[j] < 0:
            add_vector(scratch.totals, 0, scratch.of[j], vector_of(scratch.arriving, 0, j))


@kernel
def environment_emission(
    setup: Any, scene: KernelScene, state: State, background: Background
) -> Vec3:
    """Emission of the environment along a ray that hits nothing: throughput L_e, MIS-weighted."""
    weight = 1.0
    if state.bsdf_pdf > 0.0:
        previous, normal = state.previous, state.normal
        light_pdf = any_light.environment_density(
            scene.lights, previous, normal, background.density
        )
        weight = _mis_weight(setup, BSDF_SAMPLING, state.bsdf_pdf, light_pdf)
    return state.throughput * background.radiance * weight


@kernel
def hit_emission(
    setup: Any, scene: KernelScene, state: State, ray: Ray, point: SurfacePoint, at: At
) -> Vec3:
    """Emission of the area light that the ray has hit: throughput L_e, MIS-weighted."""
    lights, weight = scene.lights, 1.0
    if state.bsdf_pdf > 0.0:
        light_pdf = any_light.area_pdf(lights, scene.shapes, state.previous, state.normal, point)
        weight = _mis_weight(setup, BSDF_SAMPLING, state.bsdf_pdf, light_pdf)
    return state.throughput * any_light.emitted(lights, point, at, -ray.d) * weight


@kernel
def _weight_of_path(path: PathSetup, strategy: int, pdf: float, other: float) -> float:
    """With a single strategy, samples of the other count nothing, except where the single one
    cannot draw them (other = 0)."""
    if path.strategy == BOTH:
        return power_heuristic(pdf, other)
    return 1.0 if path.strategy == strategy or other == 0.0 else 0.0


mis_weights = ByClass("mis_weight")
"""By the class of an integrator's setup: mis_weight(setup, strategy, pdf, other) is the weight of a
sample that `strategy` drew with density `pdf`, and the other strategy would draw with density
`other`."""
mis_weights.register(PathSetup, _weight_of_path)
_mis_weight = mis_weights.function


@kernel
def connect(
    setup: Any,
    state: State,
    point: SurfacePoint,
    light: LightSample,
    picked: Pick,
    scattered: Scattered,
) -> LightConnection:
    """What a sample of the light that was picked adds, if nothing is between: throughput f |cos|
    L_e / pdf, MIS-weighted against BSDF sampling.  scattered: what the surface scatters of it."""
    contribution = scattered.value * light.radiance
    if light.pdf == 0.0 or is_black(contribution):
        return LightConnection(Vec3(0.0, 0.0, 0.0), Ray(point.p, point.n, 0.0))
    pdf, weight = light.pdf * picked.probability, 1.0
    if not light.is_delta:
        weight = _mis_weight(setup, LIGHT_SAMPLING, pdf, scattered.density)
    arriving = contribution * (weight / pdf)
    return LightConnection(state.throughput * arriving, shadow_ray(point, light))


@kernel
def go_on(
    setup: Any,
    scene: KernelScene,
    state: State,
    point: SurfacePoint,
    drawn: BsdfSample,
    sampler: Sample,
    depth: int,
) -> Step:
    """The next edge of a path, in the direction, in the world, that the BSDF has drawn at the
    surface that edge number `depth` has hit; Russian roulette may end it."""
    ended = Step(False, Ray(point.p, point.n, 0.0), state)
    if drawn.pdf == 0.0:
        return ended
    throughput, eta = state.throughput * drawn.weight, state.eta * drawn.eta
    if depth + 1 >= setup.rr_depth:
        # Radiance changes by 1 / eta² on entering a medium.  eta² undoes that: survival depends on
        # the power that is left.
        survival = min(max_component(throughput) * eta * eta, ROULETTE_CAP)
        u_roulette, _ = draw_pair(sampler, sampling.PER_BOUNCE * depth + sampling.ROULETTE)
        if not u_roulette < survival:  # also ends what is NaN
            return ended
        throughput = throughput * (1.0 / survival)
    bsdf_pdf = 0.0 if drawn.is_delta else drawn.pdf
    normal = light_selection_normal(scene, point)
    return Step(True, ray_from(point, drawn.wi), State(throughput, eta, bsdf_pdf, point.p, normal))
