"""Solids as trees of operands, and the intervals of lines in them: for the methods of `csg`."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from reference_rt import shapes as any_shape
from reference_rt.core.arrays import IntArray
from reference_rt.core.transform import Affine, affine, compose, identity, invert
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.shapes import TABLES, TRIANGLE, Shapes, csg
from reference_rt.shapes.meshes.topology import describe_boundary
from reference_rt.shapes.meshes.triangle import Triangles, on_line
from reference_rt.shapes.meshes.watertight import Shear, project, shear_of
from reference_rt.shapes.shape import Shape, TabulationContext
from reference_rt.textbook.method import FloatArray, ray_of


class CsgParameters(NamedTuple):
    """A solid in world coordinates: `rt.Sphere() & rt.Box()`, or any shape that encloses space;
    folder: of the meshes' files."""

    solid: Shape
    folder: Path = Path()


class Operand(NamedTuple):
    """A shape, the transform from the world to its own coordinates, and its table, the only one in
    `shapes`: row 0, or all rows of a mesh."""

    shape: Shape
    to_own: Affine
    shapes: Shapes
    kind: int


class Combination(NamedTuple):
    """UNION, INTERSECTION or DIFFERENCE of trees."""

    operation: int
    of: "tuple[Tree, ...]"


Tree = Operand | Combination
UNION, INTERSECTION, DIFFERENCE = range(3)
_OPERATIONS = {
    csg.Union: UNION,
    csg.Intersection: INTERSECTION,
    csg.Difference: DIFFERENCE,
}


def prepare(parameters: CsgParameters) -> Tree:
    """The tree, with the transforms of nested solids composed into the operands."""
    return _tree(parameters.solid, identity(), parameters.folder)


def _tree(shape: Shape, outer: Affine, folder: Path) -> Tree:
    to_world = compose(affine(shape.transform), outer)
    if isinstance(shape, csg.Solid):
        parts = tuple(_tree(part, to_world, folder) for part in shape.of)
        return Combination(_OPERATIONS[type(shape)], parts)
    table = shape.tabulate(TabulationContext(folder=folder, outer=outer))
    kind, field, _, module = next(entry for entry in TABLES if entry[2] is type(table))
    shapes = Shapes(**(dict.fromkeys(Shapes._fields) | {field: table}))
    if kind == TRIANGLE:
        problem = describe_boundary(table.vertices)
        if problem:
            raise ValueError(f"a {type_of(shape)}: {problem}")
    elif not (hasattr(module, "spans") and getattr(module, "is_solid", lambda _: True)(table)):
        raise ValueError(f"a {type_of(shape)} encloses no space; expected a solid")
    return Operand(shape, invert(to_world), shapes, kind)


def type_of(shape: Shape) -> str:
    return str(getattr(shape, "type", "shape"))


def leaves(tree: Tree) -> tuple[Operand, ...]:
    """The operands, from left to right."""
    if isinstance(tree, Operand):
        return (tree,)
    return tuple(operand for part in tree.of for operand in leaves(part))


# ---- boundaries of a line in an operand ---------------------------------------------------------


@entry_kernel
def _spans(shapes: Shapes, kind: int, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        found = any_shape.spans(shapes, kind, 0, ray_of(o, d, i))
        t[i, 0], t[i, 1], t[i, 2], t[i, 3] = found.t0, found.t1, found.t2, found.t3


@kernel
def _mesh_crossing(triangles: Triangles, i: int, shear: Shear) -> tuple[float, int]:
    """t, of any sign, at which the line crosses triangle i, and +1 for entering, -1 for leaving, 0
    for a miss."""
    seen = project(triangles.points, triangles.corners, i, shear)
    return on_line(seen, shear).t, seen.side


@entry_kernel
def _count(triangles: Triangles, o: FloatArray, d: FloatArray, count: IntArray) -> None:
    for i in range(len(o)):
        shear = shear_of(ray_of(o, d, i))
        for k in range(len(triangles.face)):
            if project(triangles.points, triangles.corners, k, shear).side != 0:
                count[i] += 1


@entry_kernel
def _mesh_crossings(
    triangles: Triangles, o: FloatArray, d: FloatArray, t: FloatArray, sign: IntArray
) -> None:
    for i in range(len(o)):
        shear = shear_of(ray_of(o, d, i))
        n = 0
        for k in range(len(triangles.face)):
            at, side = _mesh_crossing(triangles, k, shear)
            if side != 0:
                t[i, n], sign[i, n] = at, side
                n += 1


def boundaries(operand: Operand, o: FloatArray, d: FloatArray) -> FloatArray:
    """All t (n, k) in order at which the lines enter and leave, alternately; padded with inf.

    Every line begins outside; one that comes from inside the operand enters at -inf.
    """
    triangles = operand.shapes.triangles
    if triangles is None:
        t = np.empty((len(o), 4))
        _spans(operand.shapes, operand.kind, o, d, t)
        return trimmed(t)
    count = np.zeros(len(o), np.int64)
    _count(triangles, o, d, count)
    t = np.full((len(o), count.max(initial=0)), math.inf)
    sign = np.zeros(t.shape, np.int64)
    _mesh_crossings(triangles, o, d, t, sign)
    order = np.argsort(t, axis=1, kind="stable")
    winding = np.cumsum(np.take_along_axis(sign, order, axis=1), axis=1)
    inside = np.pad(winding != 0, ((0, 0), (1, 0)))
    # Where a mesh intersects itself, a crossing may be in its interior.
    changes = inside[:, 1:] != inside[:, :-1]
    return trimmed(np.where(changes, np.take_along_axis(t, order, axis=1), math.inf))


def trimmed(t: FloatArray) -> FloatArray:
    """Each row sorted, without columns that are all inf."""
    t = np.sort(t, axis=1)
    return np.ascontiguousarray(t[:, np.any(t < math.inf, axis=0)])
