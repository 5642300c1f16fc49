"""The tables of solids: operands, and the postfix programs that combine them."""

from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray

OR, AND, NOT = -1, -2, -3
"""Steps of a program, besides the numbers 0, 1, 2... that stand for the operands."""


class Solids(NamedTuple):
    """n solids of m operands in all.

    first, operands (n,): a solid's operands;  step_first, step_count (n,): its program in `steps`;
    depth (n,): the most values that its program holds at once.
    kind, row (m,): which primitive an operand is;  root (m,): for a mesh, whose row is -1, the node
    of the hierarchy over its triangles.
    anchor (n, 3): from where all coordinates of a solid's operands count;  reach (n,): no point of
    them is further from there, inf for infinite ones.
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
    """What the owner numbers of primitives mean that are parts of something.

    shape (k,): index in the scene;  part (k,): number of the operand in its solid, or of the shape
    in its group;  solid (k,): number of that solid, -1 elsewhere;  turned (k,): 1 where the outside
    of the solid is the inside of the operand, as what a difference takes away.
    """

    shape: IntArray
    part: IntArray
    solid: IntArray
    turned: IntArray
