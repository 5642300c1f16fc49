"""The state of a ray stream: each ray's constants, its node and stack, and the three queues."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel.bvh import CENTER, NODE_SINGLES, STACK_SIZE, Bvh
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import BLOCK, SURFACE_ROUNDING
from reference_rt.core.ray_block import HitBlock, RayBlock, ray_of
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import VECTOR_WIDTH, larger, with_sign
from reference_rt.jit.simd_kernels import prefetch, simd_kernel
from reference_rt.shapes.meshes.watertight import Shear

Naturals = npt.NDArray[np.uint32]

SLAB_FLOATS = 9 * BLOCK
LEVELS = STACK_SIZE
"""Entries of each ray's stack: nodes some of whose children are still to be visited."""


@kernel
def load_index(numbers: Naturals, i: int) -> int:
    """Element i, converted to the integers that kernels compute with."""
    number: int = np.int64(numbers[i])  # type: ignore[assignment]
    return number


class StreamState(NamedTuple):
    """A stream of up to BLOCK rays, as SoA.

    slab_rays (SLAB_FLOATS,): near, far and inverse of `single_ray.SlabRay`;  axes (6 BLOCK,): its
    rows x, y, z, and the axes x, y, z of `watertight.Shear`;  node, leaf (BLOCK,): the inner node
    or the leaf that a ray is at, a leaf as -1 - code;  nodes (LEVELS BLOCK,): each ray's stack of
    nodes with children still to be visited;  level (BLOCK,): how many these are;  queues
    (3 BLOCK,): the rays at an inner node, at a leaf, and about to pop their stack.

    Integers are unsigned: for signed indices Numba tests whether they are negative, 6 % of the time
    (measured, with children's codes in one row).
    """

    slab_rays: FloatArray
    axes: Naturals
    node: Naturals
    leaf: Naturals
    level: Naturals
    nodes: Naturals
    queues: Naturals


class Lengths(NamedTuple):
    """The lengths of the three queues."""

    nodes: int
    leaves: int
    pops: int


@kernel
def prepare(bvh: Bvh, state: StreamState, rays: RayBlock, n: int) -> None:
    """Computes what stays the same during the traversal of the first n rays: slab_rays and axes."""
    frame = bvh.frames
    for j in range(0, n, VECTOR_WIDTH):
        _prepare_slab_rays(
            rays.numbers,
            j,
            frame[0, CENTER],
            frame[0, CENTER + 1],
            frame[0, CENTER + 2],
            3.0 * frame[0, CENTER + 3],
            state.slab_rays,
        )
    for j in range(n):
        for axis in range(3):
            is_forward = state.slab_rays[(6 + axis) * BLOCK + j] > 0.0
            state.axes[axis * BLOCK + j] = axis + 3 - 3 * is_forward
        # As `watertight.shear_of`, without branches.
        d = ray_of(rays, j).d
        x_is = (abs(d.x) >= abs(d.y)) & (abs(d.x) >= abs(d.z))
        z = (1 - x_is) * (2 - (abs(d.y) >= abs(d.z)))
        first = z + 1 - 3 * (z == 2)
        second = 3 - z - first
        swap = (second - first) * (rays.numbers[(3 + z) * BLOCK + j] < 0.0)
        state.axes[3 * BLOCK + j] = first + swap
        state.axes[4 * BLOCK + j] = second - swap
        state.axes[5 * BLOCK + j] = z


@simd_kernel
def _prepare_slab_rays(
    rays: Any, j: Any, center_x: Any, center_y: Any, center_z: Any, extent: Any, slab_rays: Any
) -> Any:
    """`single_ray.slab_ray_of` the rays j to j + VECTOR_WIDTH - 1, without the rows;  extent: 3
    times the tree's size."""
    o = [rays.load(j + axis * BLOCK) for axis in range(3)]
    far_out = larger(larger(abs(o[0]), abs(o[1])), abs(o[2]))
    error = (far_out + far_out + extent) * SURFACE_ROUNDING
    for axis, center in enumerate((center_x, center_y, center_z)):
        inverse = 1.0 / rays.load(j + (3 + axis) * BLOCK)
        moved = with_sign(error, inverse)
        slab_rays.store(j + axis * BLOCK, o[axis] - center + moved)
        slab_rays.store(j + (3 + axis) * BLOCK, o[axis] - center - moved)
        slab_rays.store(j + (6 + axis) * BLOCK, inverse)
    return error >= 0.0


@kernel
def start_at_root(state: StreamState, hits: HitBlock, root: int, n: int, any_hit: bool) -> Lengths:
    """Queues all rays at a root; with `any_hit` only those without a hit so far."""
    count = 0
    for j in range(n):
        state.node[j], state.level[j] = root, 0
        state.queues[count & (BLOCK - 1)] = j
        count += not (any_hit and hits.codes[j] >= 0)
    return Lengths(count, 0, 0)


@kernel
def shear_in(state: StreamState, rays: RayBlock, j: int) -> Shear:
    """`watertight.shear_of` ray j."""
    numbers, axes = rays.numbers, state.axes
    x, y = load_index(axes, 3 * BLOCK + j), load_index(axes, 4 * BLOCK + j)
    z = load_index(axes, 5 * BLOCK + j)
    d_z = numbers[(3 + z) * BLOCK + j]
    return Shear(
        x,
        y,
        z,
        numbers[x * BLOCK + j],
        numbers[y * BLOCK + j],
        numbers[z * BLOCK + j],
        numbers[(3 + x) * BLOCK + j] / d_z,
        numbers[(3 + y) * BLOCK + j] / d_z,
        1.0 / d_z,
    )


def slab_ray_in(slab_rays: Any, axes: Any, j: Any) -> Any:
    """Ray j as `single_ray.slab_test` takes it."""
    return [
        (
            axes.load_index(j + axis * BLOCK),
            slab_rays.everywhere(j + axis * BLOCK),
            slab_rays.everywhere(j + (3 + axis) * BLOCK),
            slab_rays.everywhere(j + (6 + axis) * BLOCK),
        )
        for axis in range(3)
    ]


@kernel
def enqueue(
    bvh: Bvh, state: StreamState, j: int, code: int, met: int, level: int, lengths: Lengths
) -> Lengths:
    """Moves ray j to the child `code`, an inner node or a leaf; where no child was entered (met is
    0), to the pop queue if its stack is not empty; else the ray is done."""
    node, nodes, leaves, pops = max(code, 0), lengths.nodes, lengths.leaves, lengths.pops
    state.node[j], state.leaf[j] = node, max(-1 - code, 0)
    for line in range(4):
        prefetch(bvh.boxes, node * NODE_SINGLES + 16 * line)
    # Written to all three queues, of which at most one grows: no branch.  The masks show Numba that
    # no index is negative.
    state.queues[nodes & (BLOCK - 1)] = j
    state.queues[BLOCK + (leaves & (BLOCK - 1))] = j
    state.queues[2 * BLOCK + (pops & (BLOCK - 1))] = j
    is_met = met != 0
    return Lengths(
        nodes + (is_met & (code >= 0)),
        leaves + (is_met & (code < 0)),
        pops + ((met == 0) & (level > 0)),
    )
