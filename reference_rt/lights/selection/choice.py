"""Picks one of all lights: by power if there are few, by a light tree if there are many."""

from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.lights.selection import tree as light_tree
from reference_rt.lights.selection.tree import LightTree, Pick
from reference_rt.sampling.distribution import count_up_to

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
        picked = light_tree.pick(tree, p, n, u / bounded)
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
    if choice.bounded[0] > 0.0 and light_tree.holds(tree, k):
        return light_tree.probability(tree, p, n, k) * float(choice.bounded[0])
    return _power_of(choice.cumulative, choice, k)


@kernel
def _power_of(cumulative: FloatArray | None, choice: LightSampler, k: int) -> float:
    """The probability that `_by_power` returns light k."""
    if cumulative is None:
        return 1.0
    return float(choice.probability[k])
