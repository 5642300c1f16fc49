"""Which light a path asks: a few by their power, many by a tree."""

from typing import NamedTuple

import numpy as np

from reference_rt.kernel import kernel
from reference_rt.lights import light_tree
from reference_rt.lights.light_tree import LightTree, Pick
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.vec3 import Vec3

FEW = 8
"""Lights that are picked by power alone; more are given a tree."""


class Choice(NamedTuple):
    """Every light as one list: kind (n,) and row (n,) of its table, the probability (n,) of picking
    it by power and the running sum (n,) of these;  bounded (1,), the probability that one of those
    of the tree is picked."""

    kind: IntArray
    row: IntArray
    probability: FloatArray
    cumulative: FloatArray
    bounded: FloatArray


@kernel
def pick(choice: Choice, tree: LightTree | None, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p` with normal `n`; n = 0 for light from all sides."""
    if tree is None:
        return _by_power(choice, u)
    bounded = choice.bounded[0]
    if u < bounded:
        picked = light_tree.pick(tree, p, n, u / bounded)
        return Pick(picked.light, picked.probability * bounded)
    return _by_power(choice, u)


@kernel
def _by_power(choice: Choice, u: float) -> Pick:
    """The light whose stretch of the running sum holds `u`."""
    if len(choice.kind) == 1:
        return Pick(0, choice.probability[0])
    k = min(int(np.searchsorted(choice.cumulative, u, "right")), len(choice.kind) - 1)
    return Pick(k, choice.probability[k])


@kernel
def probability(choice: Choice, tree: LightTree | None, p: Vec3, n: Vec3, k: int) -> float:
    """The chance that `pick` gives light k."""
    if tree is None:
        return float(choice.probability[k])
    if choice.bounded[0] > 0.0 and tree.leaf[k] >= 0:
        return light_tree.probability(tree, p, n, k) * float(choice.bounded[0])
    return float(choice.probability[k])
