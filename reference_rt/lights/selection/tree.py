"""A binary tree over many lights: one is picked by how much it could shine at a point.

Conty Estevez & Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting";
Pharr, Jakob & Humphreys 2023, "Physically Based Rendering" 4ed, 12.6.3.  One light is picked: the
descent takes either child with a probability proportional to a bound on what its lights could
shine, and never loses one that does.
"""

import math
from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.core.vec3 import Vec3, cross, dot, length
from reference_rt.jit.kernel import kernel

SLACK = 2.0**-40
"""Added to angles, radii (relative) and cosines, so that their rounding never makes a node seem
dark that is not: each is right to a few dozen u = 2^-53."""

_BELOW_ONE = 1.0 - UNIT_ROUNDOFF
_HUGE = 1e300
"""Two of these still add up."""


class LightTree(NamedTuple):
    """m nodes, siblings side by side, the root first.  nodes (m, 12): center and radius of a sphere
    that contains the node's lights; unit axis, cosine and sine of the spread, cosine of the reach,
    lambertian and even intensity: see `LightBounds`; child (m,): the left child, -1 for a leaf;
    light (m,): a leaf's light.  Of every light of the scene: leaf (n,), its node, -1 where it is
    not in the tree; trail (n,): the way there from the root, lowest bit first, 1 for right.
    """

    nodes: FloatArray
    child: IntArray
    light: IntArray
    leaf: IntArray
    trail: IntArray


class Pick(NamedTuple):
    """A light and the probability of picking it; of probability 0 where no light shines."""

    light: int
    probability: float


class Angle(NamedTuple):
    cos: float
    sin: float


@kernel
def between(a: Vec3, b: Vec3) -> Angle:
    """The angle between unit vectors: the sine from the cross product keeps its digits where the
    cosine has none left."""
    return Angle(dot(a, b), length(cross(a, b)))


@kernel
def less(a: Angle, b: Angle) -> Angle:
    """max(0, a - b), of angles from 0 to pi."""
    if a.cos >= b.cos:
        return Angle(1.0, 0.0)
    return Angle(a.cos * b.cos + a.sin * b.sin, a.sin * b.cos - a.cos * b.sin)


@kernel
def importance(tree: LightTree, i: int, p: Vec3, n: Vec3) -> float:
    """A bound, but for the distance, on the irradiance from node i at `p` on a surface with unit
    normal `n`, or on one turned to the lights where n = 0.

    PBR 4ed 12.6.3: the smallest angles that any point of the sphere may have to the normals there
    and here; the distance to the center, at least the radius.
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
    leaving = less(less(between(axis, -w), spread), seen).cos + SLACK
    if leaving < cos_reach:
        return 0.0
    arriving = 1.0
    if n.x != 0.0 or n.y != 0.0 or n.z != 0.0:
        arriving = max(0.0, less(between(n, w), seen).cos + SLACK)
    bound: float = (even + lambertian * max(0.0, leaving)) * arriving / distance2
    return min(bound, _HUGE)


@kernel
def shares(tree: LightTree, i: int, p: Vec3, n: Vec3) -> tuple[float, float]:
    """The probabilities of node i and of its sibling i + 1; both 0 where neither shines."""
    left, right = importance(tree, i, p, n), importance(tree, i + 1, p, n)
    total = left + right
    if total <= 0.0:
        return 0.0, 0.0
    return left / total, right / total


@kernel
def pick(tree: LightTree, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p`, of which `n` is the unit normal on the side that light may come
    from; n = 0 for both sides.  `u` is used again at each step."""
    i, probability = 0, 1.0
    while tree.child[i] >= 0:
        i = tree.child[i]
        left, right = shares(tree, i, p, n)
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


@kernel
def probability(tree: LightTree, p: Vec3, n: Vec3, k: int) -> float:
    """The probability with which `pick` gives light k: to the last bit, of the same factors."""
    if tree.leaf[k] < 0:
        return 0.0
    i, trail, product = 0, tree.trail[k], 1.0
    while tree.child[i] >= 0:
        i = tree.child[i]
        left, right = shares(tree, i, p, n)
        if trail & 1:
            product *= right
            i += 1
        else:
            product *= left
        trail >>= 1
    return product
