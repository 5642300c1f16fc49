"""Picks one of all lights: by power if there are few, by a light tree if there are many.

A light tree is binary, and picks a light by a bound on its irradiance at a point: Conty Estevez &
Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting";
Pharr, Jakob & Humphreys 2023, "Physically Based Rendering" 4ed, 12.6.3.  The descent takes either
child with a probability proportional to a bound on the irradiance from its lights.  The bound is
conservative: every light that reaches the point has a probability above 0.
"""

import math
from typing import NamedTuple

import numpy as np

from reference_rt.accel.bvh.bins import BINS, Split, bin_of, bins_per_unit, no_split
from reference_rt.accel.bvh.nodes import center
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.core.vec3 import Vec3, cross, dot, length
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.jit.links import Linkable
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

_BELOW_ONE = 1.0 - UNIT_ROUNDOFF
_HUGE = 1e300
"""Bounds are clamped to this: the sum of two is finite."""


class LightTree(NamedTuple):
    """m nodes, siblings next to each other, the root first.  nodes (m, 12): center and radius of a
    sphere that contains the node's lights; unit axis, cosine and sine of the spread, cosine of the
    reach, lambertian and even intensity: see `LightBounds`; child (m,): the left child, -1 for a
    leaf; light (m,): a leaf's light.  For each light of the scene: leaf (n,), its node, -1 if it is
    not in the tree; trail (n,): the bits of the path there from the root, lowest first, 1 for
    right.
    """

    nodes: FloatArray
    child: IntArray
    light: IntArray
    leaf: IntArray
    trail: IntArray


class Pick(NamedTuple):
    """A light and the probability of picking it, 0 if no light reaches the point."""

    light: int
    probability: float


class Angle(NamedTuple):
    cos: float
    sin: float


@kernel
def angle_between(a: Vec3, b: Vec3) -> Angle:
    """The angle between unit vectors: the sine, from the cross product, keeps its digits for small
    angles, where the cosine has none."""
    return Angle(dot(a, b), length(cross(a, b)))


@kernel
def angle_difference(a: Angle, b: Angle) -> Angle:
    """max(0, a - b), of angles from 0 to pi."""
    if a.cos >= b.cos:
        return Angle(1.0, 0.0)
    return Angle(a.cos * b.cos + a.sin * b.sin, a.sin * b.cos - a.cos * b.sin)


@kernel
def importance(tree: LightTree, i: int, p: Vec3, n: Vec3) -> float:
    """A bound on the irradiance from node i at `p` on a surface with unit normal `n`, or on one
    that faces the lights if n = 0; a bound except that the distance is that to the node's center.

    PBR 4ed 12.6.3: it takes the smallest angles between any point of the node's sphere and the
    normals at both ends, and the distance to the center, at least the radius.
    """
    node = tree.nodes[i]
    to_center, radius = Vec3(node[0], node[1], node[2]) - p, node[3]
    axis, spread, cos_reach = Vec3(node[4], node[5], node[6]), Angle(node[7], node[8]), node[9]
    lambertian, even = node[10], node[11]
    distance2 = dot(to_center, to_center)
    if distance2 <= radius * radius:
        most: float = (lambertian + even) / max(distance2, radius * radius, 1.0 / _HUGE)
        return min(most, _HUGE)
    distance = math.sqrt(distance2)
    w = to_center * (1.0 / distance)
    sine = radius / distance
    seen = Angle(math.sqrt(max(0.0, 1.0 - sine * sine)), sine)
    leaving = angle_difference(angle_difference(angle_between(axis, -w), spread), seen).cos + SLACK
    if leaving < cos_reach:
        return 0.0
    arriving = 1.0
    if n.x != 0.0 or n.y != 0.0 or n.z != 0.0:
        arriving = max(0.0, angle_difference(angle_between(n, w), seen).cos + SLACK)
    bound: float = (even + lambertian * max(0.0, leaving)) * arriving / distance2
    return min(bound, _HUGE)


@kernel
def child_probabilities(tree: LightTree, i: int, p: Vec3, n: Vec3) -> tuple[float, float]:
    """The probabilities of node i and of its sibling i + 1; both 0 if neither reaches `p`."""
    left, right = importance(tree, i, p, n), importance(tree, i + 1, p, n)
    total = left + right
    if total <= 0.0:
        return 0.0, 0.0
    return left / total, right / total


light_trees = Linkable()
"""The operations on a light tree, or on a link to one."""


@light_trees.operation
def holds(tree: LightTree, k: int) -> bool:
    """Whether light k is in the tree."""
    return bool(tree.leaf[k] >= 0)


@light_trees.operation
def pick_in_tree(tree: LightTree, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p`;  n: its unit normal on the side that light may come from, 0 for
    both sides.  `u` is rescaled and used again at each step."""
    i, probability = 0, 1.0
    while tree.child[i] >= 0:
        i = tree.child[i]
        left, right = child_probabilities(tree, i, p, n)
        u = min(u, _BELOW_ONE)
        if u < left:
            u /= left
            probability *= left
        elif right > 0.0:
            u = (u - left) / right
            probability *= right
            i += 1
        else:
            return Pick(0, 0.0)
    return Pick(tree.light[i], probability)


@light_trees.operation
def probability_in_tree(tree: LightTree, p: Vec3, n: Vec3, k: int) -> float:
    """The probability that `pick` returns light k: the product of the same factors, to the last
    bit."""
    if tree.leaf[k] < 0:
        return 0.0
    i, trail, product = 0, tree.trail[k], 1.0
    while tree.child[i] >= 0:
        i = tree.child[i]
        left, right = child_probabilities(tree, i, p, n)
        if trail & 1:
            product *= right
            i += 1
        else:
            product *= left
        trail >>= 1
    return product


# Builds a light tree: top down, by the binned surface area orientation heuristic (Conty Estevez &
# Kulla 2018, section 4.3).


MOST_DEPTH = 28
"""Nodes at this depth and below are halved by count: with 2^32 lights the leaves are then at depth
60 at most, so that trails fit into an integer and the jobs into their stack."""


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
    order, child, trail = np.arange(n), np.full(m, -1), np.zeros(m, np.int64)
    nodes, first = np.empty((m, COLUMNS)), np.full(m, -1)
    jobs, bins, costs = np.empty((64, 4), np.int64), np.empty((BINS, COLUMNS)), np.empty(BINS)
    _split_all(rows, order, jobs, bins, costs, nodes, child, trail, first)
    light = np.where(first >= 0, lights[order[first]], -1)
    leaf, trails = np.full(count, -1), np.zeros(count, np.int64)
    leaves = np.flatnonzero(first >= 0)
    leaf[light[leaves]], trails[light[leaves]] = leaves, trail[leaves]
    return _tabulate(nodes, child, light, leaf, trails)


def _tabulate(
    nodes: FloatArray, child: IntArray, light: IntArray, leaf: IntArray, trail: IntArray
) -> LightTree:
    lower, upper = nodes[:, :3], nodes[:, 3:6]
    middle = 0.5 * lower + 0.5 * upper
    radius = np.linalg.norm(0.5 * upper - 0.5 * lower, axis=1) * (1.0 + SLACK)
    # The middle rounds, and so may a box's corners: four roundings of coordinates each.
    radius += 4.0 * math.sqrt(3.0) * UNIT_ROUNDOFF * np.abs(nodes[:, :6]).max(axis=1)
    spread = np.minimum(nodes[:, 9] + SLACK, math.pi)
    angles = np.column_stack([np.cos(spread), np.sin(spread), np.cos(nodes[:, 10])])
    packed = np.concatenate([middle, radius[:, None], nodes[:, 6:9], angles, nodes[:, 11:]], axis=1)
    return LightTree(packed, child, light, leaf, trail)


@entry_kernel
def _split_all(
    rows: FloatArray,
    order: IntArray,
    jobs: IntArray,
    bins: FloatArray,
    costs: FloatArray,
    nodes: FloatArray,
    child: IntArray,
    trail: IntArray,
    first: IntArray,
) -> None:
    """Fills the nodes, in the order of `LightTree`: their bounds, children and trails, and for a
    leaf its index in `order`."""
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
        trail[count], trail[count + 1] = trail[node], trail[node] | (1 << depth)
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
"""Lights that are picked by power alone; more are given a tree."""


class LightSampler(NamedTuple):
    """All lights in one list: kind (n,) and row (n,) in the tables, the probability (n,) of picking
    it by power and the running sum (n,) of these, None if there is only one light;  bounded (1,):
    the probability of picking from the tree."""

    kind: IntArray
    row: IntArray
    probability: FloatArray
    cumulative: FloatArray | None
    bounded: FloatArray


@kernel
def count(choice: LightSampler) -> int:
    """The number of lights: a compile-time constant if there is only one."""
    return _count(choice.cumulative)


@kernel
def _count(cumulative: FloatArray | None) -> int:
    if cumulative is None:
        return 1
    return len(cumulative)


@kernel
def pick(choice: LightSampler, tree: LightTree | None, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p` with normal `n`; n = 0 for light from both sides."""
    if tree is None:
        return _by_power(choice.cumulative, choice, u)
    bounded = choice.bounded[0]
    if u < bounded:
        picked = pick_in_tree(tree, p, n, u / bounded)
        return Pick(picked.light, picked.probability * bounded)
    return _by_power(choice.cumulative, choice, u)


@kernel
def _by_power(cumulative: FloatArray | None, choice: LightSampler, u: float) -> Pick:
    """The light whose interval of the running sum contains `u`."""
    if cumulative is None:
        return Pick(0, 1.0)
    k = min(count_up_to(cumulative, u), len(cumulative) - 1)
    return Pick(k, choice.probability[k])


@kernel
def probability(choice: LightSampler, tree: LightTree | None, p: Vec3, n: Vec3, k: int) -> float:
    """The probability that `pick` returns light k."""
    if len(choice.kind) == 0:
        return 0.0
    if tree is None:
        return _power_of(choice.cumulative, choice, k)
    if choice.bounded[0] > 0.0 and holds(tree, k):
        return probability_in_tree(tree, p, n, k) * float(choice.bounded[0])
    return _power_of(choice.cumulative, choice, k)


@kernel
def _power_of(cumulative: FloatArray | None, choice: LightSampler, k: int) -> float:
    """The probability that `_by_power` returns light k."""
    if cumulative is None:
        return 1.0
    return float(choice.probability[k])
