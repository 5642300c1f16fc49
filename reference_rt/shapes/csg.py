"""Constructive solid geometry: union, intersection and difference of solids, nested to any depth.

`sphere & box - cylinder` in Python; in a scene file a tree of unions, intersections and
differences, whose `of` lists the operands.  Operands are primitives with spans and closed meshes.
`Solids` has operands and gates of all solids of a scene.

Rays are evaluated in `accel/csg.py`: the gates combine, for each stretch of the ray, whether it is
inside of each operand.

The anchor of a solid is a local origin for the coordinates of its operands, next to them.
If the operands of a solid at a distance D from the world's origin were tabulated in the world, each
would be rounded by itself, by u D.  That would separate faces that coincide, and hide parts as thin
as that.  Here all maps are composed exactly and moved to one anchor: operands round as if the solid
stood at the origin, and the anchor is subtracted from a ray's origin once for all of them.

To add an operation: a description as `Union` in `shapes/shape.py`; a case in `postfix`, in terms of
OR, AND and NOT.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF, Ray, SurfacePoint
from reference_rt.core.transform import Affine, Transform, affine, compose, identity
from reference_rt.core.vec3 import dot, length, max_abs, row
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.rounding import along_from
from reference_rt.shapes.shape import Difference, Intersection, Shape, Solid, Union
from reference_rt.shapes.tables import Primitive

__all__ = [
    "AND",
    "NOT",
    "OR",
    "Anchored",
    "AnyShape",
    "Difference",
    "Gates",
    "Intersection",
    "Solid",
    "Solids",
    "Union",
    "anchored",
    "gates_of",
    "operands_of",
    "postfix",
]

OR, AND, NOT = -1, -2, -3
"""Operators of a program; the numbers 0, 1, 2... are the operands."""


class Solids(NamedTuple):
    """n solids of m operands in all.

    first, operands (n,): a solid's operands;  tree (n,): the root of the BVH over them, -1 for
    none;  asked_first, asked_count (n,): the place in `asked` of those that are in no BVH, which
    every ray is tested against.  kind, row (m,): the table and row of an operand's primitive;  root
    (m,): for a mesh, whose row is -1, the root of the BVH over its triangles.
    gate_first, gates (n,): the rows of a solid's gates;  up (m,), gate_up, gate_start (k,): see
    `Gates`.
    anchor (n, 3): the local origin for the coordinates of a solid's operands;  reach (n,): the
    largest distance of their points from there, inf for infinite ones.
    """

    first: IntArray
    operands: IntArray
    tree: IntArray
    asked_first: IntArray
    asked_count: IntArray
    asked: IntArray
    kind: IntArray
    row: IntArray
    root: IntArray
    gate_first: IntArray
    gates: IntArray
    up: IntArray
    gate_up: IntArray
    gate_start: IntArray
    anchor: FloatArray
    reach: FloatArray


class Parts(NamedTuple):
    """For the owner numbers of primitives that are parts of a solid or of a group.

    shape (k,): the shape id, an index in the scene;  part (k,): the operand id in the solid, or the
    index of the shape in the group;  solid (k,): number of the solid, -1 if it is none;  turned
    (k,): 1 if the outside of the solid is the inside of the operand, as of a subtracted one.
    """

    shape: IntArray
    part: IntArray
    solid: IntArray
    turned: IntArray


AnyOperand = Annotated[Primitive | Union | Intersection | Difference, Field(discriminator="type")]
AnyShape = Annotated[
    Primitive | Union | Intersection | Difference | Instance, Field(discriminator="type")
]

for _model in (Solid, Union, Intersection, Difference):
    _model.model_rebuild(_types_namespace={"AnyOperand": AnyOperand})


def operands_of(
    shape: Shape, outer: Affine, material: str | None, turned: bool = False
) -> Iterator[tuple[Shape, Affine, str | None, bool]]:
    """The primitive operands of a tree, from left to right: (shape, the map that is applied after
    its own transform, material, whether the solid's outside is its inside)."""
    material = shape.material if shape.material is not None else material
    if not isinstance(shape, Solid):
        yield shape, outer, material, turned
        return
    outer = compose(affine(shape.transform), outer)
    for k, operand in enumerate(shape.of):
        takes_away = isinstance(shape, Difference) and k > 0
        yield from operands_of(operand, outer, material, turned != takes_away)


def postfix(shape: Shape) -> list[int]:
    """The tree as a program: operands are numbered in the order of `operands_of`."""
    steps: list[int] = []
    count = 0

    def visit(part: Shape) -> None:
        nonlocal count
        if not isinstance(part, Solid):
            steps.append(count)
            count += 1
            return
        visit(part.of[0])
        for operand in part.of[1:]:
            visit(operand)
            if isinstance(part, Difference):
                steps.append(NOT)
            steps.append(OR if isinstance(part, Union) else AND)

    visit(shape)
    return steps


class Gates(NamedTuple):
    """A program as gates, each of which is on where any of its inputs is; an input may be negated.
    The solid changes where gate 0 does.

    up (m,): where an operand goes, 2 gate + 1 if negated, else 2 gate;  gate_up (k,): where a gate
    goes, likewise, -1 for gate 0;  start (k,): how many of its inputs are on where a point is
    outside of all operands.
    """

    up: list[int]
    gate_up: list[int]
    start: list[int]


class _Gate(list[tuple["int | _Gate", bool]]):
    """The inputs of a gate, operands or gates, and whether each is negated."""


def gates_of(steps: Sequence[int]) -> Gates:
    """The gates of a program: a and b is not (not a or not b), and a gate that goes to another
    unchanged is part of it, so that a union of any number of operands is a single gate."""
    stack: list[tuple[int | _Gate, bool]] = []
    for step in steps:
        if step >= 0:
            stack.append((step, False))
        elif step == NOT:
            of, negated = stack.pop()
            stack.append((of, not negated))
        else:
            (b, not_b), (a, not_a) = stack.pop(), stack.pop()
            turned = step == AND
            gate = a if isinstance(a, _Gate) and not_a == turned else _Gate([(a, not_a != turned)])
            if isinstance(b, _Gate) and not_b == turned:
                gate += b
            else:
                gate.append((b, not_b != turned))
            stack.append((gate, turned))
    whole, _ = stack.pop()
    waiting = [(whole if isinstance(whole, _Gate) else _Gate([(whole, False)]), -1)]
    up = [0] * (1 + max(steps))
    gate_up: list[int] = []
    while waiting:
        gate, to = waiting.pop()
        number = len(gate_up)
        gate_up.append(to)
        for of, negated in gate:
            if isinstance(of, _Gate):
                waiting.append((of, 2 * number + negated))
            else:
                up[of] = 2 * number + negated
    start = [0] * len(gate_up)
    for to in up:
        start[to >> 1] += to & 1
    for number in range(len(gate_up) - 1, 0, -1):  # each goes to one before it
        to = gate_up[number]
        start[to >> 1] += int((start[number] > 0) != (to & 1 == 1))
    return Gates(up, gate_up, start)


_exact = np.vectorize(Fraction, otypes=[object])

FAR = 16.0
"""A solid whose distance from the world's origin is at most this number of its sizes keeps the
world's coordinates: there operands round at most 16 times more than they must, as other shapes
do."""


class Anchored(NamedTuple):
    """anchor (3,), 0 for the world's origin;  operands: (shape, the map that is applied after its
    own transform), relative to the anchor."""

    anchor: FloatArray
    operands: list[tuple[Shape, Affine]]


def anchored(solid: Shape) -> Anchored:
    """The operands of a solid, from left to right.

    The anchor is the local origin of an operand or, of a sphere, the centre: the first in the order
    of coordinates, so that the order of operands does not matter.  Raises ValueError where
    coordinates overflow.
    """
    operands_with_steps = list(_placed_operands(solid, ()))
    try:
        maps = [_map_of(shape, steps) for shape, steps in operands_with_steps]
        anchor = min(maps, key=lambda m: tuple(m[:, 3]))[:, 3].astype(np.float64)
        for m in maps:
            m[:, 3] -= _exact(anchor)
        floats = [m.astype(np.float64) for m in maps]
    except (OverflowError, ValueError):
        raise ValueError("its coordinates overflow; expected finite numbers") from None
    if np.abs(anchor).max() <= FAR * np.abs(floats).max():
        operands = operands_of(solid, identity(), None)
        return Anchored(np.zeros(3), [(shape, outer) for shape, outer, _, _ in operands])
    seen: list[tuple[Shape, Affine]] = []
    for (shape, _), m in zip(operands_with_steps, floats, strict=True):
        update: dict[str, Any] = {"transform": ()}
        if hasattr(shape, "center"):
            update["center"] = (0.0, 0.0, 0.0)  # in the map
        seen.append((shape.model_copy(update=update), m))
    return Anchored(anchor, seen)


def _placed_operands(shape: Shape, outer: Transform) -> Iterator[tuple[Shape, Transform]]:
    """(operand, the steps from its own coordinates to the world's)."""
    steps = (*shape.transform, *outer)
    if not isinstance(shape, Solid):
        yield shape, steps
        return
    for operand in shape.of:
        yield from _placed_operands(operand, steps)


def _map_of(shape: Shape, steps: Transform) -> Any:
    """The map (3, 4), exactly; the centre of a shape that has one is taken as its origin."""
    linear, offset = _exact(np.eye(3)), _exact(getattr(shape, "center", (0.0, 0.0, 0.0)))
    for step in steps:
        m = _exact(step.matrix_of())
        linear, offset = m[:, :3] @ linear, m[:, :3] @ offset + m[:, 3]
    return np.column_stack([linear, offset])


@kernel
def ray_near(solids: Solids | None, s: int, ray: Ray) -> tuple[Ray, float]:
    """(the ray relative to the anchor of solid s, begin): the ray's t is begin + t of that ray;
    unchanged for s = -1.

    The origin of a ray from far outside of all operands is moved next to them, without rounding
    (`along_from`): its crossings then round in proportion to the solid's size, not to its distance.
    If already the rounding of begin is larger than the solid, the origin is not moved.
    """
    if solids is None:
        return ray, 0.0
    if s < 0:
        return ray, 0.0
    anchor, reach = row(solids.anchor, s), solids.reach[s]
    seen = Ray(ray.o - anchor, ray.d, ray.t_max)
    if not max_abs(seen.o) > 8.0 * reach:
        return seen, 0.0
    speed = length(ray.d)
    begin = (-dot(seen.o, ray.d) / speed - 4.0 * reach) / speed
    if not begin > 0.0:
        return seen, 0.0
    o = along_from(ray.o, ray.d, anchor, begin)
    if not dot(o, ray.d) < -2.0 * reach * speed:
        return seen, 0.0
    return Ray(o, ray.d, ray.t_max), begin


@kernel
def out_of_solid(solids: Solids | None, s: int, point: SurfacePoint) -> SurfacePoint:
    """A point relative to the anchor of solid s, in the world; unchanged for s = -1.

    That adds three roundings, of numbers no larger than the anchor and the point: of the point, of
    the next ray's origin next to it, and of that relative to the anchor.
    """
    if solids is None:
        return point
    if s < 0:
        return point
    anchor = row(solids.anchor, s)
    if max_abs(anchor) == 0.0:
        return point
    p = anchor + point.p
    rounding = (4.0 * 1.7320508075688774 * UNIT_ROUNDOFF) * (max_abs(anchor) + max_abs(p))
    return SurfacePoint(p, point.n, point.ns, point.error + rounding, point.material, point.light)
