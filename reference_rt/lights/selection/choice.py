"""Picks one of all lights: by power if there are few, by a light tree if there are many.

A light tree picks a light by a bound on its irradiance at a point: Conty Estevez & Kulla 2018,
"Importance Sampling of Many Lights with Adaptive Tree Splitting"; Pharr, Jakob & Humphreys 2023,
"Physically Based Rendering" 4ed, 12.6.3.  The descent takes one of a node's children with a
probability proportional to a bound on the irradiance from its lights.  The bound is conservative:
every light that reaches the point has a probability above 0.

The tree is built binary.  Then each node gets the children three levels below it, whose bounds are
computed as one vector: a pick among 10,000 lights takes 0.37 of the binary tree's time (measured).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from reference_rt.accel.bvh.bins import BINS, Split, bin_of, bins_per_unit, no_split
from reference_rt.accel.bvh.nodes import center
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.jit.links import Linkable
from reference_rt.jit.simd import VECTOR_WIDTH, larger, select, simd_lanes, smaller, square_root
from reference_rt.lights.selection.bounds import (
    COLUMNS,
    LightBounds,
    as_rows,
    cost,
    load,
    nothing,
    store,
    union,
)
from reference_rt.sampling.distribution import count_up_to

SLACK = 2.0**-40
"""Added to angles, radii (relative) and cosines, whose errors are a few dozen u = 2^-53, so that
rounding never makes the bound of a node that emits 0."""

_NODE_COLUMNS = 12
_NODE_SIZE = _NODE_COLUMNS * VECTOR_WIDTH
_BELOW_ONE = 1.0 - UNIT_ROUNDOFF
_HUGE = 1e300
"""Bounds are clamped to this: the sum of two is finite."""


class LightTree(NamedTuple):
    """m nodes of VECTOR_WIDTH children each, the root first.  nodes (m, 12, VECTOR_WIDTH), for each
    child: center and radius of a sphere that contains its lights; unit axis, cosine and sine of the
    spread, cosine of the reach, lambertian and even intensity: see `LightBounds`; all 0 for a child
    that is missing.  children (m, VECTOR_WIDTH): a child's node, or -1 - k for light k.  For each
    light of the scene: trail (n,), the numbers of the children on the path there from the root,
    BITS bits each, lowest first; -1 if it is not in the tree.
    """

    nodes: FloatArray
    children: IntArray
    trail: IntArray


BITS = VECTOR_WIDTH.bit_length() - 1


class Pick(NamedTuple):
    """A light and the probability of picking it, 0 if no light reaches the point."""

    light: int
    probability: float


def _difference(cos_a: Any, sin_a: Any, cos_b: Any, sin_b: Any) -> tuple[Any, Any]:
    """Cosine and sine of max(0, a - b), of angles from 0 to pi."""
    is_less = cos_a >= cos_b
    cosine = select(is_less, 1.0, cos_a * cos_b + sin_a * sin_b)
    return cosine, select(is_less, 0.0, sin_a * cos_b - cos_a * sin_b)


def _between(a: Any, b: Any, inverse: Any, inverse2: Any) -> tuple[Any, Any]:
    """Cosine and sine of the angle between vectors a and b, of which a is a unit vector, and
    inverse and inverse2 are the inverse of b's length and its square.  The sine, from the cross
    product, keeps its digits for small angles, where the cosine has none."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    sine = square_root((x * x + y * y + z * z) * inverse2)
    return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * inverse, sine


@simd_lanes
def _importances(
    nodes: Any, node: Any, p_x: Any, p_y: Any, p_z: Any, n_x: Any, n_y: Any, n_z: Any
) -> Any:
    """For each child of a node a bound on the irradiance from it at p on a surface with unit normal
    n, or on one that faces the lights if n = 0; a generic kernel (see `jit.simd`).  It is a bound
    except that the distance is that to the child's center.

    PBR 4ed 12.6.3: it takes the smallest angles between any point of the child's sphere and the
    normals at both ends, and the distance to the center, at least the radius.
    """
    columns = [nodes.load(node * _NODE_SIZE + k * VECTOR_WIDTH) for k in range(_NODE_COLUMNS)]
    c_x, c_y, c_z, radius, *axis, cos_spread, sin_spread, cos_reach, lambertian, even = columns
    x, y, z = c_x - p_x, c_y - p_y, c_z - p_z
    distance2, radius2 = x * x + y * y + z * z, radius * radius
    is_inside = distance2 <= radius2
    inverse2 = 1.0 / larger(larger(distance2, radius2), 1.0 / _HUGE)
    inverse = square_root(inverse2)
    seen = square_root(larger(1.0 - radius2 * inverse2, 0.0)), radius * inverse
    cosine, sine = _between((axis[0], axis[1], axis[2]), (x, y, z), inverse, inverse2)
    leaving, sine = _difference(-cosine, sine, cos_spread, sin_spread)
    leaving = _difference(leaving, sine, *seen)[0] + SLACK
    arriving = _between((n_x, n_y, n_z), (x, y, z), inverse, inverse2)
    arriving = larger(_difference(*arriving, *seen)[0] + SLACK, 0.0)
    arriving = select(n_x * n_x + n_y * n_y + n_z * n_z > 0.0, arriving, 1.0)
    bound = (even + lambertian * larger(leaving, 0.0)) * arriving
    bound = select(leaving < cos_reach, 0.0, bound)
    return smaller(select(is_inside, lambertian + even, bound) * inverse2, _HUGE)


class Child(NamedTuple):
    """number: a child's among those of its node, -1 for none;  probability: of descending there;
    u: the random number that chose it, rescaled to be used again."""

    number: int
    probability: float
    u: float


@kernel
def _chosen(importances: tuple[float, ...], u: float) -> Child:
    """The child that `u` chooses, with a probability proportional to its importance."""
    a, b, c, d, e, f, g, h = importances
    after_a = a
    after_b = after_a + b
    after_c = after_b + c
    after_d = after_c + d
    after_e = after_d + e
    after_f = after_e + f
    after_g = after_f + g
    total = after_g + h
    x = min(u, _BELOW_ONE) * total  # below the total
    # Sums and choices of values: branches that take either way would cost more than all the rest.
    number = int(x >= after_a) + int(x >= after_b) + int(x >= after_c) + int(x >= after_d)
    number += int(x >= after_e) + int(x >= after_f) + int(x >= after_g)
    own = b if x >= after_a else a
    own = c if x >= after_b else own
    own = d if x >= after_c else own
    own = e if x >= after_d else own
    own = f if x >= after_e else own
    own = g if x >= after_f else own
    own = h if x >= after_g else own
    before = after_a if x >= after_a else 0.0
    before = after_b if x >= after_b else before
    before = after_c if x >= after_c else before
    before = after_d if x >= after_d else before
    before = after_e if x >= after_e else before
    before = after_f if x >= after_f else before
    before = after_g if x >= after_g else before
    if own <= 0.0:
        return Child(-1, 0.0, u)
    return Child(number, own / total, (x - before) / own)


light_trees = Linkable()
"""The operations on a light tree, or on a link to one."""


@light_trees.operation
def holds(tree: LightTree, k: int) -> bool:
    """Whether light k is in the tree."""
    return bool(tree.trail[k] >= 0)


@light_trees.operation
def pick_in_tree(tree: LightTree, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p`;  n: its unit normal on the side that light may come from, 0 for
    both sides."""
    node, probability = 0, 1.0
    while node >= 0:
        child = _chosen(_importances(tree.nodes, node, p.x, p.y, p.z, n.x, n.y, n.z), u)
        if child.number < 0:
            return Pick(0, 0.0)
        node = tree.children[node, child.number]
        u = child.u
        probability *= child.probability
    return Pick(-1 - node, probability)


@light_trees.operation
def probability_in_tree(tree: LightTree, p: Vec3, n: Vec3, k: int) -> float:
    """The probability that `pick` returns light k: the product of the same factors, to the last
    bit."""
    node, trail, product = 0, tree.trail[k], 1.0
    if trail < 0:
        return 0.0
    while node >= 0:
        number = trail & (VECTOR_WIDTH - 1)
        importances = _importances(tree.nodes, node, p.x, p.y, p.z, n.x, n.y, n.z)
        product *= _share(importances, number)
        node = tree.children[node, number]
        trail >>= BITS
    return product


@kernel
def _share(importances: tuple[float, ...], number: int) -> float:
    """The probability of a child, with the roundings of `_chosen`."""
    a, b, c, d, e, f, g, h = importances
    total = a + b + c + d + e + f + g + h
    if total <= 0.0:
        return 0.0
    return importances[number] / total


# Builds a light tree: top down, by the binned surface area orientation heuristic (Conty Estevez &
# Kulla 2018, section 4.3).


MOST_DEPTH = 28
"""Nodes at this depth and below are halved by count: with 2^32 lights the leaves are then at depth
60 at most, so that the BITS bits of each BITS levels fit into an integer, and the jobs into their
stack."""


def build(bounds: LightBounds, lights: IntArray, count: int) -> LightTree:
    """The tree over n lights with these bounds;  lights (n,): their numbers among the scene's
    `count` lights.  Raises ValueError."""
    n = len(lights)
    strength = bounds.lambertian + bounds.even
    if n == 0 or not np.all((strength > 0.0) & (strength < np.inf)):
        raise ValueError("a light tree over lights without power; expected ones that shine")
    rows = as_rows(bounds)
    rows[:, -2:] /= strength.max()  # sums of extremes would overflow
    if not np.isfinite(rows).all():
        raise ValueError("a light tree over lights that are not finite; expected finite ones")
    m = 2 * n - 1
    order, child = np.arange(n), np.full(m, -1)
    nodes, first = np.empty((m, COLUMNS)), np.full(m, -1)
    jobs, bins, costs = np.empty((64, 4), np.int64), np.empty((BINS, COLUMNS)), np.empty(BINS)
    _split_all(rows, order, jobs, bins, costs, nodes, child, first)
    light = np.where(first >= 0, lights[order[first]], -1)
    return _widened(_numbers_of_importance(nodes), child, light, count)


def _widened(packed: FloatArray, child: IntArray, light: IntArray, count: int) -> LightTree:
    """A binary tree as one whose children are BITS levels below their node, or are lights.

    packed (m, 12): the nodes' numbers;  child (m,): the left one, the right one follows it, -1 for
    a leaf;  light (m,): a leaf's.
    """
    nodes, children, trails = [], [], np.full(count, -1)
    roots, trail, known, depth = np.zeros(1, np.int64), np.zeros(1, np.int64), 1, 0
    while len(roots):
        slots = roots[:, None]  # nodes of the binary tree, -1 for none
        for _ in range(BITS):
            left = np.where(slots >= 0, child[slots], -1)
            right = np.where(left >= 0, left + 1, -1)
            slots = np.stack([np.where(left >= 0, left, slots), right], axis=-1)
            slots = slots.reshape(len(roots), -1)
        is_inner = (slots >= 0) & (child[slots] >= 0)
        found = packed[slots] * (slots >= 0)[..., None]
        nodes.append(np.ascontiguousarray(found.transpose(0, 2, 1)))
        is_leaf = (slots >= 0) & ~is_inner
        below = np.where(is_leaf, -1 - light[slots], -1)
        below[is_inner] = np.arange(known, known + is_inner.sum())
        children.append(below)
        to_child = trail[:, None] | np.arange(VECTOR_WIDTH) << BITS * depth
        trails[light[slots[is_leaf]]] = to_child[is_leaf]
        roots, trail = slots[is_inner], to_child[is_inner]
        known, depth = known + len(roots), depth + 1
    return LightTree(np.concatenate(nodes), np.concatenate(children), trails)


def _numbers_of_importance(nodes: FloatArray) -> FloatArray:
    """(m, 12): the columns of `LightTree.nodes`, from bounds (m, COLUMNS)."""
    lower, upper = nodes[:, :3], nodes[:, 3:6]
    middle = 0.5 * lower + 0.5 * upper
    radius = np.linalg.norm(0.5 * upper - 0.5 * lower, axis=1) * (1.0 + SLACK)
    # The middle rounds, and so may a box's corners: four roundings of coordinates each.
    radius += 4.0 * math.sqrt(3.0) * UNIT_ROUNDOFF * np.abs(nodes[:, :6]).max(axis=1)
    spread = np.minimum(nodes[:, 9] + SLACK, math.pi)
    angles = np.column_stack([np.cos(spread), np.sin(spread), np.cos(nodes[:, 10])])
    return np.concatenate([middle, radius[:, None], nodes[:, 6:9], angles, nodes[:, 11:]], axis=1)


@entry_kernel
def _split_all(
    rows: FloatArray,
    order: IntArray,
    jobs: IntArray,
    bins: FloatArray,
    costs: FloatArray,
    nodes: FloatArray,
    child: IntArray,
    first: IntArray,
) -> None:
    """Fills the nodes, siblings next to each other, the root first: their bounds and left children,
    and for a leaf its index in `order`."""
    count, top = 1, _push(jobs, 0, 0, 0, len(order), 0)
    while top > 0:
        top -= 1
        node, begin, end, depth = jobs[top, 0], jobs[top, 1], jobs[top, 2], jobs[top, 3]
        if end - begin == 1:
            first[node] = begin
            continue
        middle = (begin + end) // 2
        if depth < MOST_DEPTH:
            middle = _cut(rows, order, begin, end, bins, costs)
        child[node] = count
        top = _push(jobs, top, count + 1, middle, end, depth + 1)
        top = _push(jobs, top, count, begin, middle, depth + 1)
        count += 2
    for i in range(count - 1, -1, -1):  # children come after their parents
        if first[i] >= 0:
            store(nodes, i, load(rows, order[first[i]]))
        else:
            store(nodes, i, union(load(nodes, child[i]), load(nodes, child[i] + 1)))


@kernel
def _push(jobs: IntArray, top: int, node: int, begin: int, end: int, depth: int) -> int:
    """Pushes a job; returns the new height of the stack."""
    job = jobs[top]
    job[0], job[1], job[2], job[3] = node, begin, end, depth
    return top + 1


@kernel
def _cut(
    rows: FloatArray, order: IntArray, begin: int, end: int, bins: FloatArray, costs: FloatArray
) -> int:
    """Partitions order[begin:end] and returns where the second part begins."""
    best, best_low, best_scale = no_split(), 0.0, 0.0
    for axis in range(3):
        low, high = math.inf, -math.inf
        for k in range(begin, end):
            c = center(rows[order[k]], axis)
            low, high = min(low, c), max(high, c)
        scale = bins_per_unit(low, high)
        if scale > 0.0:
            split = _best_of_axis(rows, order, begin, end, axis, low, scale, bins, costs)
            if split.cost < best.cost:
                best, best_low, best_scale = split, low, scale
    if best.axis < 0:
        return (begin + end) // 2
    i, j = begin, end - 1
    while i <= j:
        if bin_of(center(rows[order[i]], best.axis), best_low, best_scale) <= best.bin:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i if begin < i < end else (begin + end) // 2


@kernel
def _best_of_axis(
    rows: FloatArray,
    order: IntArray,
    begin: int,
    end: int,
    axis: int,
    low: float,
    scale: float,
    bins: FloatArray,
    costs: FloatArray,
) -> Split:
    """The cheapest plane between bins."""
    for b in range(BINS):
        store(bins, b, nothing())
    for k in range(begin, end):
        b = bin_of(center(rows[order[k]], axis), low, scale)
        store(bins, b, union(load(bins, b), load(rows, order[k])))
    beyond = nothing()
    for b in range(BINS - 1, 0, -1):
        beyond = union(load(bins, b), beyond)
        costs[b] = cost(beyond)
    best, before = no_split(), nothing()
    for b in range(BINS - 1):
        before = union(before, load(bins, b))
        if before.spread >= 0.0:
            total = cost(before) + costs[b + 1]
            if total < best.cost:
                best = Split(total, axis, b)
    return best


FEW = 8
"""Lights that are picked by power alone; more are given a tree.  With a tree, variance times time
is this many times that by power, for triangles strewn over a floor and 64 Sobol' points (measured):
0.3 to 1.4 for 12 of them, 1.1 to 2.8 for 16, 0.3 for 24, 0.1 for 48 to 1,000, 0.4 for 10,000 and
1.1 for 100,000; and for 8 points, which pick by power only some of the lights, 0.1 to 0.4 for 12
and 0.1 for 16.  A pick takes a third to a half more of the time of a picture."""


class LightSampler(NamedTuple):
    """All lights in one list: kind (n,) and row (n,) in the tables, the probability (n,) of picking
    it by power and the running sum (n,) of these;  bounded (1,): the probability of picking from
    the tree, as kernels take it 0 if there is none."""

    kind: IntArray
    row: IntArray
    probability: FloatArray
    cumulative: FloatArray
    bounded: FloatArray


@kernel
def pick(choice: LightSampler, tree: Any, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p` with normal `n`; n = 0 for light from both sides."""
    bounded = choice.bounded[0]
    if u < bounded:
        picked = pick_in_tree(tree, p, n, u / bounded)
        return Pick(picked.light, picked.probability * bounded)
    return _by_power(choice, u)


@kernel
def _by_power(choice: LightSampler, u: float) -> Pick:
    """The light whose interval of the running sum contains `u`."""
    cumulative = choice.cumulative
    k = min(count_up_to(cumulative, u), len(cumulative) - 1)
    return Pick(k, choice.probability[k])


@kernel
def probability(choice: LightSampler, tree: Any, p: Vec3, n: Vec3, k: int) -> float:
    """The probability that `pick` returns light k."""
    if len(choice.kind) == 0:
        return 0.0
    if choice.bounded[0] > 0.0 and holds(tree, k):
        return probability_in_tree(tree, p, n, k) * float(choice.bounded[0])
    return float(choice.probability[k])
