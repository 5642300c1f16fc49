"""What a path is between two surfaces, and how those of a block are kept."""

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
    """What a path is when it goes on.

    throughput: the weight of what it finds;  eta: of the product of the media's it has entered;
    how its ray was chosen: with density bsdf_pdf, 0 for the eye and for delta lobes, whose finds no
    light sample competes for, from `previous`, for a light-picking normal.
    """

    throughput: Vec3
    eta: float
    bsdf_pdf: float
    previous: Vec3
    normal: Vec3


@kernel
def start(ray: Ray) -> State:
    """A path at the eye."""
    return State(Vec3(1.0, 1.0, 1.0), 1.0, 0.0, ray.o, ray.d)


@kernel
def state_of(scene: SceneTables, scratch: Scratch, j: int) -> State:
    """That of path number j of those that go on."""
    numbers, nowhere = scratch.states, Vec3(0.0, 0.0, 0.0)
    eta = numbers[4 * BLOCK + j] if any_material.any_transmits(scene.materials) else 1.0
    previous = vector_of(numbers, 5, j) if any_light.asks_place(scene.lights) else nowhere
    normal = vector_of(numbers, 8, j) if any_light.asks_normal(scene.lights) else nowhere
    return State(vector_of(numbers, 0, j), eta, numbers[3 * BLOCK + j], previous, normal)


@kernel
def put_state(scene: SceneTables, scratch: Scratch, j: int, k: int, state: State) -> None:
    """As number j of the paths that go on, the path of sample k; what this scene never asks is
    left out (measured: storing all takes 3 % longer, of spheres under a sky)."""
    scratch.samples[j] = k
    numbers = scratch.states
    put_vector(numbers, 0, j, state.throughput)
    numbers[3 * BLOCK + j] = state.bsdf_pdf
    if any_material.any_transmits(scene.materials):
        numbers[4 * BLOCK + j] = state.eta
    if any_light.asks_place(scene.lights):
        put_vector(numbers, 5, j, state.previous)
    if any_light.asks_normal(scene.lights):
        put_vector(numbers, 8, j, state.normal)
