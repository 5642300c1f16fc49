"""Rays of a block on their ways through a hierarchy: what is known of each, and who is where."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel.bvh import CENTER, NODE_SINGLES, STACK_SIZE, Bvh
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import BLOCK, SURFACE_ROUNDING
from reference_rt.core.ray_block import Hits, Rays, ray_of
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import LANES, larger, with_sign
from reference_rt.jit.simd_kernels import lane_kernel, prefetch
from reference_rt.shapes.meshes.watertight import Shear

Naturals = npt.NDArray[np.uint32]

VIEW_FLOATS = 9 * BLOCK
LEVELS = STACK_SIZE
"""Most nodes of which children wait for one ray."""


@kernel
def natural(numbers: Naturals, i: int) -> int:
    """Number i, as other integers."""
    number: int = np.int64(numbers[i])  # type: ignore[assignment]
    return number


class Wave(NamedTuple):
    """Rays on their ways, BLOCK of each number.

    views (VIEW_FLOATS,): near, far and inverse of `traversal.View`;  axes (6 BLOCK,): its rows x,
    y, z, and the axes x, y, z of `watertight.Shear`;  node, leaf (BLOCK,): where a ray is, a leaf
    by -1 less its code;  nodes (LEVELS BLOCK,): of which children wait for it, `level` (BLOCK,) of
    them;  queues (3 BLOCK,): rays at nodes, at leaves, and on their way back.

    Numba asks of each index whether it is negative, but not of natural numbers: 6 % of the time
    (measured, with children's codes in one row).
    """

    views: FloatArray
    axes: Naturals
    node: Naturals
    leaf: Naturals
    level: Naturals
    nodes: Naturals
    queues: Naturals


class Lengths(NamedTuple):
    """Of the queues."""

    nodes: int
    leaves: int
    back: int


@kernel
def prepare(bvh: Bvh, wave: Wave, rays: Rays, n: int) -> None:
    """What of the first n rays does not change on their ways."""
    frame = bvh.frames
    for j in range(0, n, LANES):
        _look(
            rays.numbers,
            j,
            frame[0, CENTER],
            frame[0, CENTER + 1],
            frame[0, CENTER + 2],
            3.0 * frame[0, CENTER + 3],
            wave.views,
        )
    for j in range(n):
        for axis in range(3):
            is_forward = wave.views[(6 + axis) * BLOCK + j] > 0.0
            wave.axes[axis * BLOCK + j] = axis + 3 - 3 * is_forward
        # As `watertight.shear_of`, without branches.
        d = ray_of(rays, j).d
        x_is = (abs(d.x) >= abs(d.y)) & (abs(d.x) >= abs(d.z))
        z = (1 - x_is) * (2 - (abs(d.y) >= abs(d.z)))
        first = z + 1 - 3 * (z == 2)
        second = 3 - z - first
        swap = (second - first) * (rays.numbers[(3 + z) * BLOCK + j] < 0.0)
        wave.axes[3 * BLOCK + j] = first + swap
        wave.axes[4 * BLOCK + j] = second - swap
        wave.axes[5 * BLOCK + j] = z


@lane_kernel
def _look(
    rays: Any, j: Any, center_x: Any, center_y: Any, center_z: Any, extent: Any, views: Any
) -> Any:
    """`traversal.view_of` LANES rays from number j on, but for the rows;  extent: 3 times the
    tree's size."""
    o = [rays.load(j + axis * BLOCK) for axis in range(3)]
    far_out = larger(larger(abs(o[0]), abs(o[1])), abs(o[2]))
    error = (far_out + far_out + extent) * SURFACE_ROUNDING
    for axis, center in enumerate((center_x, center_y, center_z)):
        inverse = 1.0 / rays.load(j + (3 + axis) * BLOCK)
        moved = with_sign(error, inverse)
        views.store(j + axis * BLOCK, o[axis] - center + moved)
        views.store(j + (3 + axis) * BLOCK, o[axis] - center - moved)
        views.store(j + (6 + axis) * BLOCK, inverse)
    return error >= 0.0


@kernel
def begin_at(wave: Wave, hits: Hits, root: int, n: int, any_hit: bool) -> Lengths:
    """All rays stand before a root; where `any_hit`, those that have not met anything."""
    count = 0
    for j in range(n):
        wave.node[j], wave.level[j] = root, 0
        wave.queues[count & (BLOCK - 1)] = j
        count += not (any_hit and hits.codes[j] >= 0)
    return Lengths(count, 0, 0)


@kernel
def shear_in(wave: Wave, rays: Rays, j: int) -> Shear:
    """`watertight.shear_of` ray j."""
    numbers, axes = rays.numbers, wave.axes
    x, y = natural(axes, 3 * BLOCK + j), natural(axes, 4 * BLOCK + j)
    z = natural(axes, 5 * BLOCK + j)
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


def view_in(views: Any, axes: Any, j: Any) -> Any:
    """That of ray j, as `between` takes it."""
    return [
        (
            axes.natural(j + axis * BLOCK),
            views.everywhere(j + axis * BLOCK),
            views.everywhere(j + (3 + axis) * BLOCK),
            views.everywhere(j + (6 + axis) * BLOCK),
        )
        for axis in range(3)
    ]


@kernel
def queued(
    bvh: Bvh, wave: Wave, j: int, code: int, met: int, level: int, lengths: Lengths
) -> Lengths:
    """Ray j goes to the child of a code, or, where none was met, back, if children wait for it at
    any level; else it is done."""
    node, nodes, leaves, back = max(code, 0), lengths.nodes, lengths.leaves, lengths.back
    wave.node[j], wave.leaf[j] = node, max(-1 - code, 0)
    for line in range(4):
        prefetch(bvh.boxes, node * NODE_SINGLES + 16 * line)
    # Into all three queues, of which one grows at most; the masks tell that no index is negative.
    wave.queues[nodes & (BLOCK - 1)] = j
    wave.queues[BLOCK + (leaves & (BLOCK - 1))] = j
    wave.queues[2 * BLOCK + (back & (BLOCK - 1))] = j
    is_met = met != 0
    return Lengths(
        nodes + (is_met & (code >= 0)),
        leaves + (is_met & (code < 0)),
        back + ((met == 0) & (level > 0)),
    )
