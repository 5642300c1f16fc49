"""The state of a path between two surfaces, and its SoA storage for a block of paths."""

from typing import NamedTuple

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt.core.ray import BLOCK, Ray
from reference_rt.core.ray_block import put_vector, vector_of
from reference_rt.core.vec3 import Vec3
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.integrators.scratch import Scratch
from reference_rt.jit.kernel import kernel


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
