"""A binary tree over many lights, which picks one by a bound on its irradiance at a point.

Conty Estevez & Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting";
Pharr, Jakob & Humphreys 2023, "Physically Based Rendering" 4ed, 12.6.3.  The descent takes either
child with a probability proportional to a bound on the irradiance from its lights.  The bound is
conservative: every light that reaches the point has a probability above 0.
"""

import math
from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.core.vec3 import Vec3, cross, dot, length
from reference_rt.jit.kernel import kernel
from reference_rt.jit.links import Linkable

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
def pick(tree: LightTree, p: Vec3, n: Vec3, u: float) -> Pick:
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
def probability(tree: LightTree, p: Vec3, n: Vec3, k: int) -> float:
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
