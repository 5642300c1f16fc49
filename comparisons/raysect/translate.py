"""Our solids as raysect's, from descriptions, never from our tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons import shapes
from comparisons.geometry import affine
from comparisons.geometry.affine import Affine
from comparisons.geometry.flatten import Leaf, Member, Tree
from comparisons.renderers import NoCounterpartError
from comparisons.shapes.shape import RaysectPart
from reference_rt.core.model import name_of
from reference_rt.shapes import Plane

Node = dict[str, Any]
"""See `worker`."""

SIZE = 1024.0
"""How large all solids of a scene together are to be: raysect's epsilons are absolute, and in
solids as large as 1 it puts hits of small tori where nothing is (findings/)."""

LARGE = 64.0 * SIZE
"""Half the side of the box that stands for a half-space: the plane's error is so many times the
rounding."""

SMALLEST = SIZE / 32.0
"""Major radius of tori below which raysect does not decide: the rounding errors of its quartics
grow with powers of the distance in units of the torus.  Of 3,000 rays from a distance of `SIZE`
that are aimed at a torus, 1 to 2 % are beyond the rung's tolerance for a radius of 0.016 of it,
0.17 % for 0.02, and none for 0.03, however thin."""


def node_of(member: Member, outer: Affine) -> Node:
    """A member of a copy;  outer: the map from the copy's coordinates to those of the rays.  Raises
    NoCounterpartError."""
    tree: Tree | int = 0 if member.tree is None else member.tree
    if not _is_bounded(tree, member.leaves):
        raise NoCounterpartError("plane: raysect has bounded solids alone")
    return _of_tree(tree, member.leaves, outer)


def _is_bounded(tree: Tree | int, leaves: Sequence[Leaf]) -> bool:
    if isinstance(tree, int):
        return not isinstance(leaves[tree].shape, Plane)
    bounded = [_is_bounded(part, leaves) for part in tree.of]
    if tree.operation == "difference":
        return bounded[0]
    return any(bounded) if tree.operation == "intersection" else all(bounded)


def _combined(operation: str, of: list[Node]) -> Node:
    return of[0] if len(of) == 1 else {"type": operation, "of": of}


def _of_tree(tree: Tree | int, leaves: Sequence[Leaf], outer: Affine) -> Node:
    if isinstance(tree, int):
        return _of_leaf(leaves[tree], outer)
    return _combined(tree.operation, [_of_tree(part, leaves, outer) for part in tree.of])


def _of_leaf(leaf: Leaf, outer: Affine) -> Node:
    known, shape = shapes.type_of(leaf.shape), leaf.shape
    if known.to_raysect is None:
        raise NoCounterpartError(f"{name_of(type(shape))}: raysect has none in float64")
    m = affine.compose(affine.of_steps(shape.transform), affine.compose(leaf.outer, outer))
    return _combined("intersection", [_placed(part, m) for part in known.to_raysect(shape)])


def _half_space(m: Affine) -> Node:
    """A large box below the plane z = 0 under a map."""
    n = affine.apply_normals(m, np.array([[0.0, 0.0, 1.0]]))[0]
    across = np.linalg.svd(n[None])[2][1:]
    turn = np.column_stack([*across, n])
    place = np.column_stack([turn, m[:, 3] - LARGE * n])
    return {"type": "box", "sizes": [LARGE] * 3, "map": place.tolist()}


def _placed(part: RaysectPart, m: Affine) -> Node:
    m = affine.compose(part.place, m)
    if part.type == "half_space":
        return _half_space(m)
    # A map that enlarges is given to the sizes: raysect's bounds of a sphere ignore it.
    size = float(np.linalg.svd(m[:, :3], compute_uv=False)[0])
    linear = np.column_stack([m[:, :3] / size, m[:, 3]])
    sizes = [size * length for length in part.sizes]
    return {"type": part.type, "sizes": sizes, "map": linear.tolist()}


def check(node: Node) -> None:
    """Raise NoCounterpartError for what raysect does not decide in coordinates of `SIZE`."""
    for part in node.get("of", ()):
        check(part)
    if node["type"] == "torus":
        least = np.linalg.svd(np.array(node["map"])[:, :3], compute_uv=False)[-1]
        if least * node["sizes"][0] < SMALLEST:
            raise NoCounterpartError("torus: too small beside all solids for raysect's quartics")
