"""The order of crossings along a ray: by t, and at equal t a fixed order of the primitives."""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.core.ray import Hit
from reference_rt.jit.kernel import kernel
from reference_rt.shapes import Shapes


class OrderedCrossing(NamedTuple):
    """A crossing with the keys that order it.  owner, face: index of the shape and of its face;
    number: counts the ray's crossings with the same primitive, or with the same solid, from 0.  A
    `hit` of kind -1 comes after all crossings at its t."""

    hit: Hit
    owner: int
    face: int
    number: int


FROM_THE_START = OrderedCrossing(Hit(-math.inf, -1, -1, 0.0, 0.0, -1), -1, -1, -1)
"""Comes before every crossing."""


@kernel
def nothing_at(t: float) -> OrderedCrossing:
    """No crossing: begins a search beyond t, or is the result of one up to t that found none."""
    return OrderedCrossing(Hit(t, -1, -1, 0.0, 0.0, -1), -1, -1, -1)


@kernel
def ordered_crossing(shapes: Shapes, hit: Hit, number: int) -> OrderedCrossing:
    """The crossing at `hit`, with number `number` of its primitive or solid."""
    owner = any_shape.owner(shapes, hit.kind, hit.row)
    return OrderedCrossing(hit, owner, any_shape.face(shapes, hit), number)


@kernel
def precedes(shapes: Shapes, hit: Hit, other: Hit) -> bool:
    """Whether `hit` wins over another one at the same t: by instance, kind, shape and face, so that
    the order of traversal cannot change a picture."""
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
def comes_after(one: OrderedCrossing, other: OrderedCrossing) -> bool:
    """Whether a crossing comes after another: by t, then as in `precedes`, then by number.

    A total order: a crossing that comes neither before nor after another is the same one, found
    again because its primitive is in several leaves.
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
