"""Light tracing: paths that begin at the lamps (Arvo 1986; Dutré, Lafortune & Willems 1993).

A particle leaves a lamp with some power (`lights.emission`), and is scattered from surface to
surface as a path from the camera is.  At each surface it is connected with the camera: what the
surface scatters of it towards the camera, or towards a point of its lens, is added to the picture
where the camera sees the surface, unless something is between.

Powers and importances are not radiances (Veach 1997, 5.3 and 7.3.3).  At a surface with the
geometric normal n, for light from l and the next direction o, and f(o, l) |cos l| as the material
has it for a viewer at o, shading normals included,

    power after / power before = f(o, l) |cos l| |n o| / (|n l| pdf(o)).

So f is always asked for the viewer at o, also where the BSDF has drawn o for a viewer at l: nothing
is assumed of its symmetry.  For a delta lobe, which cannot be evaluated, the factor 1 / eta^2 of
refracted radiance is undone, and by Snell's law l + eta o is along the lobe's normal h: the weight
is multiplied by eta^2 |h l| / |h o| |n o| / |n l|.

No particle finds the camera through a perfect mirror or glass.  What the camera sees there, and the
lamps and the sky that it sees directly, are traced from the camera (`radiances`): a camera ray goes
on by delta lobes alone at the first surface, and then as that of `path`.  Both parts together have
the expectation of `path`; their noise is another.  Caustics, the worst of `path`, are what
particles are best at; a small surface far away is hardly ever met by one.
"""

import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.block_query import any_hits, closest_hits
from reference_rt.cameras import LENS_CENTRE, see
from reference_rt.cameras.filter_values import filter_reach, filter_value
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description, Examples
from reference_rt.core.ray import (
    BLOCK,
    HitBlock,
    RayBlock,
    hit_of,
    point_of,
    put_ray,
    put_vector,
    ray_from,
    ray_of,
    segment_to,
    vector_of,
)
from reference_rt.core.vec3 import Vec3, dot, is_black, max_component
from reference_rt.integrators.path import (
    BOTH,
    ROULETTE_CAP,
    UNLIMITED,
    PathSetup,
    Scratch,
    State,
    advance,
    ask,
    begin,
    meet,
    next_edges,
    put_state,
    scatter,
    state_of,
)
from reference_rt.integrators.scene_tables import KernelScene, surfaces
from reference_rt.integrators.shading import frame_at, place
from reference_rt.jit.kernel import kernel
from reference_rt.lights import ask_for_no_light
from reference_rt.lights.emission import Emission, emit
from reference_rt.materials import (
    Asked,
    BsdfSample,
    drawn_in,
    lit_in,
    put_asked,
    put_place,
)
from reference_rt.sampling import Samplers, draw_pair, sampler_of


class Light(Description):
    """Light tracing: particles from the lamps, each connected with the camera at every surface.

    The expected picture is that of `path`, and has caustics of lamps without extent besides.  What
    is seen in perfect mirrors and through glass is traced from the camera as there, since no
    particle finds the camera so.
    """

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"max_depth": 3, "rr_depth": 2, "caustics_of_points": False},
    )
    deterministic: ClassVar[bool] = False
    follows_scattered: ClassVar[bool] = False
    type: Literal["light"] = "light"
    max_depth: Annotated[int, Field(ge=0)] | None = None
    """Most edges of a path, the one to the camera included, as of `path`: 1 shows emission alone,
    2 adds direct light.  Default: no limit."""
    rr_depth: Annotated[int, Field(ge=1, le=4096)] = 5
    """Edges, counted from the lamp, after which Russian roulette may end a particle, from 1 to
    4096.  The mean does not depend on it."""
    caustics_of_points: bool = True
    """Whether light of lamps without extent that a mirror or glass is the first to meet is there.
    `path` never finds it; without it the expected picture is that of `path`."""

    def setup(self) -> "LightSetup":
        limit = UNLIMITED if self.max_depth is None else min(self.max_depth, UNLIMITED)
        return LightSetup(limit, self.rr_depth, self.caustics_of_points)


class LightSetup(NamedTuple):
    max_depth: int
    rr_depth: int
    caustics_of_points: bool


@kernel
def radiances(
    light: LightSetup, scene: KernelScene, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    """Estimates of what no particle brings along the first n of `scratch.rays`, into
    `scratch.totals`: light that meets no surface, and paths whose first surface, seen from the
    camera, is passed by a delta lobe."""
    path = PathSetup(light.max_depth, light.rr_depth, BOTH, False)
    begin(n, scratch)
    if light.max_depth > 0:
        meet(path, scene, 0, n, scratch)
        if light.max_depth > 1:
            ask(scene, samplers, 0, n, scratch)
            for j in range(n):
                ask_for_no_light(scratch.lit, j)
            scatter(scene, n, scratch, scratch.rays)
            for j in range(n):
                if not drawn_in(scratch.scattered, j).is_delta:
                    scratch.scattered.codes[j] = -1
            n = next_edges(path, scene, samplers, 0, n, scratch)
            advance(path, scene, samplers, 1, n, scratch)


class Target(NamedTuple):
    """Where particles are seen.  view: a camera's, or a link to it;  has_lens: whether lens points
    are drawn;  film_filter: a filter's setup, or a link to it;  shape: width and height in pixels;
    sums (pixels, 3): what is added to."""

    view: Any
    has_lens: int
    film_filter: Any
    shape: tuple[int, int]
    sums: FloatArray


_DRAWN = 18 * BLOCK, 27 * BLOCK
"""The columns of a `ScatterBlock` in which `put_scattered` stores the drawn direction."""

DRAWN_FLOATS, SEEN_FLOATS = 27 * BLOCK, 6 * BLOCK


class LightScratch(NamedTuple):
    """Buffers beside those of a path.  towards: rays against which the materials are evaluated:
    from the viewer to the surface;  blocked: hits of shadow rays;  drawn (DRAWN_FLOATS,): the
    columns of a `ScatterBlock` with drawn directions, kept;  seen (SEEN_FLOATS,): columns of film
    points and of the origins of camera rays, the third is not used."""

    towards: RayBlock
    blocked: HitBlock
    drawn: FloatArray
    seen: FloatArray


@kernel
def trace_particles(
    light: LightSetup,
    scene: KernelScene,
    emission: Emission,
    target: Target,
    samplers: Samplers,
    n: int,
    scratch: Scratch,
    more: LightScratch,
) -> None:
    """Trace n particles, and add what the camera sees of them to `target.sums`, as the sum over
    particles of estimates of the picture times the number of pixels: with one particle a pixel, the
    mean is the picture."""
    if len(emission.probability) == 0 or light.max_depth < 2:
        return
    n = _emit(scene, emission, samplers, n, scratch)
    for depth in range(1, light.max_depth):
        if n == 0:
            break
        closest_hits(scene.geometry, scratch.rays, scratch.hits, n)
        surfaces(scene, scratch.rays, scratch.hits, n, scratch.points)
        _ask_materials(scene, samplers, depth, n, scratch)
        _connect(scene, target, samplers, depth, n, scratch, more)
        if depth + 1 >= light.max_depth:
            break
        n = _go_on(light, scene, samplers, depth, n, scratch, more)


@kernel
def _emit(
    scene: KernelScene, emission: Emission, samplers: Samplers, n: int, scratch: Scratch
) -> int:
    """The particles' first rays; how many there are.  A state's `previous` is the power of its
    particle at the lamp, `throughput` what is left of it, and `bsdf_pdf` 0 for a lamp without
    extent, which no sampled direction finds."""
    going = 0
    for j in range(n):
        sampler = sampler_of(samplers, j)
        u_pick, _ = draw_pair(sampler, sampling.LIGHT_AND_LOBE)
        at, around = draw_pair(sampler, sampling.LIGHT_POINT), draw_pair(sampler, sampling.FILM)
        sent = emit(scene.lights, emission, scene.shapes, scene.textures, u_pick, at, around)
        if not is_black(sent.power):
            put_ray(scratch.rays, going, sent.ray)
            found = 0.0 if sent.is_delta else 1.0
            state = State(Vec3(1.0, 1.0, 1.0), 1.0, found, sent.power, sent.ray.d)
            put_state(scratch, going, j, state)
            going += 1
    return going


@kernel
def _ask_materials(
    scene: KernelScene, samplers: Samplers, depth: int, n: int, scratch: Scratch
) -> None:
    """What is asked of materials at each surface."""
    materials, dimension = scene.materials, sampling.PER_BOUNCE * depth
    is_flattened = any_material.are_flattened(materials)
    for j in range(n):
        scratch.scattered.codes[j] = -1
        if scratch.hits.codes[j] < 0:
            continue
        ray, hit = ray_of(scratch.rays, j), hit_of(scratch.hits, j)
        point, sampler = point_of(scratch.points, j), sampler_of(samplers, scratch.samples[j])
        m = point.material
        if not (is_flattened or any_material.scatters(materials, m)) or dot(ray.d, point.n) == 0.0:
            continue
        u_lobe, _ = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
        u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
        frame, _ = frame_at(materials, scene.geometry, ray, hit, point)
        kind, i = (0, 0) if is_flattened else (materials.kind[m], materials.row[m])
        put_asked(scratch.scattered, j, kind, i, Asked(frame, u_lobe, u0, u1))
        if any_material.uses_textures(materials, m):
            put_place(scratch.scattered, j, place(scene, m, ray, hit))


@kernel
def _look(scratch: Scratch, more: LightScratch, j: int, is_asked: bool, d: Vec3) -> None:
    """Particle j's surface is looked at along d, if that is asked."""
    l = -vector_of(scratch.rays.numbers, 3, j)
    put_vector(scratch.lit.numbers, 0, j, l)
    scratch.lit.numbers[6 * BLOCK + j] = 1.0 if is_asked else 0.0
    put_vector(more.towards.numbers, 3, j, d if is_asked else -l)


@kernel
def _connect(
    scene: KernelScene,
    target: Target,
    samplers: Samplers,
    depth: int,
    n: int,
    scratch: Scratch,
    more: LightScratch,
) -> None:
    """Adds what the camera sees of the surfaces."""
    width, height = target.shape
    seen, reach, waiting = more.seen, filter_reach(target.film_filter), 0
    for j in range(n):
        if scratch.scattered.codes[j] < 0:
            continue
        point, lens = point_of(scratch.points, j), LENS_CENTRE
        if target.has_lens != 0:
            sampler = sampler_of(samplers, scratch.samples[j])
            lens = draw_pair(sampler, sampling.PER_BOUNCE * depth + sampling.LENS)
        found = see(target.view, point.p, lens)
        x, y = found.x * width, found.y * height
        is_asked = (
            found.weight > 0.0
            and abs(x - 0.5 * width) < 0.5 * width + reach
            and abs(y - 0.5 * height) < 0.5 * height + reach
            and any_material.is_smooth(scene.materials, point.material)
        )
        _look(scratch, more, j, is_asked, found.d)
        put_vector(seen, 0, j, Vec3(x, y, found.weight))
        put_vector(seen, 3, j, found.o)
    scatter(scene, n, scratch, more.towards)
    for j in range(n):
        if scratch.scattered.codes[j] < 0 or scratch.lit.numbers[6 * BLOCK + j] == 0.0:
            continue
        value, state, point = (
            lit_in(scratch.scattered, j).value,
            state_of(scratch, j),
            point_of(scratch.points, j),
        )
        l, d = vector_of(scratch.rays.numbers, 3, j), vector_of(more.towards.numbers, 3, j)
        place_of, o = vector_of(seen, 0, j), vector_of(seen, 3, j)
        share = place_of.z * abs(dot(d, point.n) / dot(l, point.n))
        arriving = state.previous * state.throughput * value * share
        if not is_black(arriving):
            put_ray(scratch.shadows, waiting, segment_to(point, o))
            put_vector(scratch.arriving, 0, waiting, arriving)
            put_vector(seen, 0, waiting, place_of)
            waiting += 1
    any_hits(scene.geometry, scratch.shadows, more.blocked, waiting)
    for j in range(waiting):
        if more.blocked.codes[j] < 0:
            _splat(target, reach, seen[j], seen[BLOCK + j], vector_of(scratch.arriving, 0, j))


@kernel
def _splat(target: Target, reach: float, x: float, y: float, value: Vec3) -> None:
    """Adds to all pixels whose filter reaches the film point (x, y)."""
    width, height = target.shape
    first_x, last_x = math.ceil(x - 0.5 - reach), math.floor(x - 0.5 + reach)
    first_y, last_y = math.ceil(y - 0.5 - reach), math.floor(y - 0.5 + reach)
    for j in range(max(0, int(first_y)), min(height - 1, int(last_y)) + 1):
        weight_y = filter_value(target.film_filter, y - (j + 0.5))
        for i in range(max(0, int(first_x)), min(width - 1, int(last_x)) + 1):
            one = value * (weight_y * filter_value(target.film_filter, x - (i + 0.5)))
            k = j * width + i
            target.sums[k, 0] += one.x
            target.sums[k, 1] += one.y
            target.sums[k, 2] += one.z


@kernel
def _go_on(
    light: LightSetup,
    scene: KernelScene,
    samplers: Samplers,
    depth: int,
    n: int,
    scratch: Scratch,
    more: LightScratch,
) -> int:
    """The next rays; how many particles are left."""
    numbers, (first, last) = scratch.scattered.numbers, _DRAWN
    for j in range(n):
        scratch.lit.numbers[6 * BLOCK + j] = 0.0
    scatter(scene, n, scratch, scratch.rays)
    for k in range(first, last):
        more.drawn[k] = numbers[k]
    for j in range(n):
        if scratch.scattered.codes[j] >= 0:
            drawn = drawn_in(scratch.scattered, j)
            _look(scratch, more, j, drawn.pdf > 0.0 and not drawn.is_delta, -drawn.wi)
    scatter(scene, n, scratch, more.towards)
    for k in range(first, last):
        numbers[k] = more.drawn[k]
    alive = 0
    for j in range(n):
        if scratch.scattered.codes[j] < 0:
            continue
        drawn, state, k = drawn_in(scratch.scattered, j), state_of(scratch, j), scratch.samples[j]
        is_lost = drawn.is_delta and depth == 1 and state.bsdf_pdf == 0.0
        if drawn.pdf == 0.0 or (is_lost and not light.caustics_of_points):
            continue
        point, l = point_of(scratch.points, j), -vector_of(scratch.rays.numbers, 3, j)
        share = abs(dot(drawn.wi, point.n) / dot(l, point.n))
        if drawn.is_delta:
            passed = drawn.weight * (share * _delta_factor(l, drawn))
        else:
            passed = lit_in(scratch.scattered, j).value * (share / drawn.pdf)
        throughput = state.throughput * passed
        if depth >= light.rr_depth:
            survival = min(max_component(throughput), ROULETTE_CAP)
            dimension = sampling.PER_BOUNCE * depth + sampling.ROULETTE
            u_roulette, _ = draw_pair(sampler_of(samplers, k), dimension)
            if not u_roulette < survival:
                continue
            throughput = throughput * (1.0 / survival)
        if not is_black(throughput):
            put_ray(scratch.rays, alive, ray_from(point, drawn.wi))
            put_state(scratch, alive, k, State(throughput, 1.0, 0.0, state.previous, drawn.wi))
            alive += 1
    return alive


@kernel
def _delta_factor(l: Vec3, drawn: BsdfSample) -> float:
    """eta^2 |h l| / |h o| of a delta lobe; 1 for reflection, and where nothing is bent."""
    eta = drawn.eta
    if eta == 1.0:
        return 1.0
    c = dot(l, drawn.wi)
    return eta * eta * abs((1.0 + eta * c) / (c + eta))
