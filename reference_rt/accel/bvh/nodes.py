"""Binary BVH nodes, the limits that all builders keep, and operations on boxes.

A box is six numbers, lower corner and upper corner; an empty one is +inf and -inf.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeVar

import numpy as np

from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.jit.simd import VECTOR_WIDTH, simd_kernel

T = TypeVar("T")
U = TypeVar("U")

REF_FLOATS = VECTOR_WIDTH
"""Size of a builder's reference: a box, and two more numbers, so that it is a vector."""
LEAF_SIZE = 4
"""The most references of a leaf, except for the method "none": more are always split, fewer where
that is cheaper."""
SAH_DEPTH = 40
"""From this depth on, nodes are halved by count instead of by SAH."""
STACK_SIZE = 72
"""Entries of every stack over a binary BVH; no input needs more.  A node at SAH_DEPTH has at most
2^32 references, whose scratch would fill 224 GiB, and 30 halvings leave LEAF_SIZE of these: no leaf
is below depth 70, the root being at 0; median trees are halved from the root on.  A traversal needs
at most one sibling for each level above its node, 70; a builder one more, for the node, 71."""

FAR_SLACK = 1.0 + 2.0 * (3.0 * UNIT_ROUNDOFF) / (1.0 - 3.0 * UNIT_ROUNDOFF)
"""A factor for far distances.  (plane - o) * (1/d) rounds three times: a far distance stretched by
twice gamma_3 cannot make a ray miss a box that it meets (Ize 2013, "Robust BVH Ray Traversal",
JCGT 2(2))."""


class Nodes(NamedTuple):
    """A binary BVH in world space.  boxes (n, 6): lower and upper corners;  first (n,): an inner
    node's left child (the right one follows it), a leaf's first reference;  size (n,): a leaf's
    number of references, 0 for an inner node.  Node 0 is the root; children follow their
    parents."""

    boxes: FloatArray
    first: IdArray
    size: IdArray


@kernel
def clear(box: FloatArray) -> None:
    """Make `box` empty."""
    for k in range(3):
        box[k] = np.inf
        box[3 + k] = -np.inf


@kernel
def is_empty(box: FloatArray) -> bool:
    """Whether no point is in `box`."""
    return bool(box[0] > box[3] or box[1] > box[4] or box[2] > box[5])


@kernel
def assign(into: FloatArray, box: FloatArray) -> None:
    """Copies `box` into `into`."""
    for k in range(6):
        into[k] = box[k]


@kernel
def merge(into: FloatArray, box: FloatArray) -> None:
    """Grow `into` until it holds `box`."""
    for k in range(3):
        into[k] = min(into[k], box[k])
        into[3 + k] = max(into[3 + k], box[3 + k])


@kernel
def half_area(box: FloatArray) -> float:
    """Half the surface area of a box (6,), 0 for an empty one."""
    if is_empty(box):
        return 0.0
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return float(x * y + y * z + z * x)


@kernel
def joint_half_area(a: FloatArray, b: FloatArray) -> float:
    """Half the surface area of the box around two."""
    x = max(a[3], b[3]) - min(a[0], b[0])
    y = max(a[4], b[4]) - min(a[1], b[1])
    z = max(a[5], b[5]) - min(a[2], b[2])
    return float(x * y + y * z + z * x)


@kernel
def center(box: FloatArray, axis: int) -> float:
    """The middle of a box along an axis; halved before it is summed, which cannot overflow."""
    return float(0.5 * box[axis] + 0.5 * box[3 + axis])


@kernel
def push(jobs: IntArray, top: int, a: int, b: int, c: int) -> int:
    """Pushes three numbers on a builder's stack of nodes still to be made; the new top."""
    jobs[top, 0], jobs[top, 1], jobs[top, 2] = a, b, c
    return top + 1


@simd_kernel
def _exchange(refs: Any, i: Any, j: Any) -> Any:
    one, other = refs.load(i), refs.load(j)
    refs.store(i, other)
    refs.store(j, one)
    return one < 0.0


@kernel
def swap(refs: FloatArray, ids: IdArray, i: int, j: int) -> None:
    """Exchanges references i and j: boxes (m + 1, REF_FLOATS) and primitives' indices (m,)."""
    _exchange(refs, REF_FLOATS * i, REF_FLOATS * j)
    ids[i], ids[j] = ids[j], ids[i]


def on_threads(run: Callable[[T], U], items: Iterable[T]) -> Iterator[U]:
    """Yields what `run` returns for each item, in their order, on as many threads as there are
    cores; kernels run without the GIL."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(run, items)


def aligned(n: int, k: int) -> FloatArray:
    """(n, k) zeros, aligned to cache lines: with k a multiple of 8, so is each row."""
    memory = np.zeros(n * k + 8)
    skipped = (-memory.ctypes.data % 64) // 8
    return memory[skipped : skipped + n * k].reshape(n, k)


def new_nodes(m: int) -> Nodes:
    """Uninitialised nodes for m >= 1 references: every leaf holds one, and as many inner nodes as
    leaves but one join them."""
    return Nodes(np.empty((2 * m, 6)), np.empty(2 * m, np.int32), np.empty(2 * m, np.int32))


def trimmed(nodes: Nodes, count: int) -> Nodes:
    """The first `count` of `new_nodes`; the room for more is given back."""
    for column in nodes:
        column.resize((count, *column.shape[1:]), refcheck=False)
    return nodes


@entry_kernel
def fit(nodes: Nodes, references: IdArray, primitives: FloatArray) -> None:
    """Fill the nodes' boxes from the primitives' (n, 6), leaves first."""
    for i in range(len(nodes.first)):
        node = len(nodes.first) - 1 - i
        box, first, size = nodes.boxes[node], nodes.first[node], nodes.size[node]
        clear(box)
        if size == 0:
            merge(box, nodes.boxes[first])
            merge(box, nodes.boxes[first + 1])
        for k in range(first, first + size):
            merge(box, primitives[references[k]])
