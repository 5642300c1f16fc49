"""The tables of solids: operands, and the postfix programs that combine them."""

from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray

OR, AND, NOT = -1, -2, -3
"""Operators of a program; the numbers 0, 1, 2... are the operands."""


class Solids(NamedTuple):
    """n solids of m operands in all.

    first, operands (n,): a solid's operands;  step_first, step_count (n,): its program in `steps`;
    depth (n,): the stack depth of its program.  kind, row (m,): the table and row of an operand's
    primitive;  root (m,): for a mesh, whose row is -1, the root of the BVH over its triangles.
    anchor (n, 3): the local origin for the coordinates of a solid's operands;  reach (n,): the
    largest distance of their points from there, inf for infinite ones.
    """

    first: IntArray
    operands: IntArray
    step_first: IntArray
    step_count: IntArray
    depth: IntArray
    steps: IntArray
    kind: IntArray
    row: IntArray
    root: IntArray
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
