"""The order of crossings along a ray: by t, and at one t in the order of the scene."""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.core.ray import Hit
from reference_rt.jit.kernel import kernel
from reference_rt.shapes import Shapes


class Crossed(NamedTuple):
    """One of all crossings of a ray.  owner, face: of the primitive that was hit;  number: which of
    those with the same primitive, or with the same solid, it is, from 0 on.  A `hit` of kind -1
    stands for every crossing at its t: what comes after it has a larger t."""

    hit: Hit
    owner: int
    face: int
    number: int


FROM_THE_START = Crossed(Hit(-math.inf, -1, -1, 0.0, 0.0, -1), -1, -1, -1)
"""Every crossing comes after this."""


@kernel
def nothing_at(t: float) -> Crossed:
    """No crossing: what stands before a search beyond t, or is found by one up to t in vain."""
    return Crossed(Hit(t, -1, -1, 0.0, 0.0, -1), -1, -1, -1)


@kernel
def crossed(shapes: Shapes, hit: Hit, number: int) -> Crossed:
    """A crossing, number `number` of its primitive or solid."""
    owner = any_shape.owner(shapes, hit.kind, hit.row)
    return Crossed(hit, owner, any_shape.face(shapes, hit), number)


@kernel
def precedes(shapes: Shapes, hit: Hit, other: Hit) -> bool:
    """Which of two hits at the same t counts: by kind, then in the order of the scene, so that no
    order of traversal can change a picture."""
    if hit.instance != other.instance:
        return hit.instance < other.instance
    if hit.kind != other.kind:
        return hit.kind < other.kind
    owners = (
        any_shape.owner(shapes, hit.kind, hit.row),
        any_shape.owner(shapes, other.kind, other.row),
    )
    if owners[0] != owners[1]:
        return owners[0] < owners[1]
    return any_shape.face(shapes, hit) < any_shape.face(shapes, other)


@kernel
def comes_after(one: Crossed, other: Crossed) -> bool:
    """Whether a crossing comes after another, at one t in the order of `precedes`.

    A total order: what is neither before nor after a crossing is that crossing itself, met a second
    time because a hierarchy leads to its primitive twice.
    """
    a, b = one.hit, other.hit
    if a.t != b.t or b.kind < 0:
        return a.t > b.t
    if a.instance != b.instance:
        return a.instance > b.instance
    if a.kind != b.kind:
        return a.kind > b.kind
    if one.owner != other.owner:
        return one.owner > other.owner
    if one.face != other.face:
        return one.face > other.face
    return one.number > other.number
