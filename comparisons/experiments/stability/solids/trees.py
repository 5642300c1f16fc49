"""Trees of set operations, and the laws by which one is written as another of the same points."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.meshes import BALL
from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.experiments.stability.harness.steps import at, scaled, turned, vector
from comparisons.geometry.affine import unit_vectors

Tree = int | tuple[str, "Tree", "Tree"]
"""The number of a shape, or ("|", "&" or "-", a, b)."""

MOST_LEAVES = 200
"""Of a tree that laws make longer."""

KINDS = ("sphere", "ellipsoid", "box", "cylinder", "cone", "quadric", "torus", "mesh")


def placed(rng: np.random.Generator, size: float, offset: float) -> tuple[Any, ...]:
    """Any rotation, a size and a translation."""
    axis, middle = (vector(v) for v in unit_vectors(rng, 2))
    turn = turned(float(rng.uniform(0.0, 360.0)), axis)
    middle = vector(np.array(middle) * rng.uniform(0.0, offset))
    return scaled(size), turn, at(*middle)


def leaf(rng: np.random.Generator, kind: str, steps: tuple[Any, ...]) -> Any:
    """A solid of about unit size, under these steps."""
    if kind == "sphere":
        return rt.Sphere(radius=float(rng.uniform(0.7, 1.2)), transform=steps)
    if kind == "ellipsoid":
        stretch = scaled(*rng.uniform(0.4, 1.2, 3).tolist())
        return rt.Sphere(transform=(stretch, *steps))
    if kind == "box":
        return rt.Box(transform=steps)
    if kind == "cylinder":
        return rt.Cylinder(radius=0.8, z_min=-0.9, z_max=0.7, capped=True, transform=steps)
    if kind == "cone":
        top = float(rng.choice([0.0, 0.4]))
        return rt.Cone(radius=1.0, height=1.5, top_radius=top, capped=True, transform=steps)
    if kind == "quadric":
        saddle = (1.0, 1.0, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5)
        return rt.Quadric(
            coefficients=saddle, lower=(-1, -1, -1), upper=(1, 1, 1), capped=True, transform=steps
        )
    if kind == "torus":
        return rt.Torus(major_radius=0.9, minor_radius=0.4, transform=steps)
    return rt.Mesh(file=BALL, transform=steps)


@dataclass(frozen=True)
class Shapes:
    """The shapes that trees are of."""

    leaves: Sequence[Any]

    def solid(self, tree: Tree) -> Any:
        """As a description; of a single shape, a solid all the same."""
        if isinstance(tree, int):
            return rt.Union(of=(self.leaves[tree],))
        return self._part(tree)

    def _part(self, tree: Tree) -> Any:
        if isinstance(tree, int):
            return self.leaves[tree]
        operation, a, b = tree
        kind = {"|": rt.Union, "&": rt.Intersection, "-": rt.Difference}[operation]
        return kind(of=(self._part(a), self._part(b)))


def chain(rng: np.random.Generator, depth: int, leaves: int) -> Tree:
    """Operations in each other, `depth` of them: unions twice as often as others, so that there is
    something left."""
    tree: Tree = int(rng.integers(leaves))
    for _ in range(depth):
        operation = str(rng.choice(["|", "|", "&", "-"]))
        other = int(rng.integers(leaves))
        tree = (operation, tree, other) if rng.random() < 0.7 else (operation, other, tree)
    return tree


def size(tree: Tree) -> int:
    return 1 if isinstance(tree, int) else size(tree[1]) + size(tree[2])


def rewritten(rng: np.random.Generator, tree: Tree, laws: int, leaves: int) -> Tree:
    """The same points by another tree: `laws` laws, each at a place of its own."""
    for _ in range(laws):
        if size(tree) > MOST_LEAVES:
            break
        tree = _at(rng, tree, int(rng.integers(2 * size(tree) - 1)), int(rng.integers(leaves)))
    return tree


def _at(rng: np.random.Generator, tree: Tree, place: int, other: int) -> Tree:
    """A law applied to the node that is number `place` from above, of 2 leaves - 1."""
    if place == 0 or isinstance(tree, int):
        return _law(rng, tree, other)
    operation, a, b = tree
    left = 2 * size(a) - 1
    if place <= left:
        return operation, _at(rng, a, place - 1, other), b
    return operation, a, _at(rng, b, place - 1 - left, other)


def _law(rng: np.random.Generator, a: Tree, b: Tree) -> Tree:
    """One of the laws that fit; b is any tree."""
    ways: list[Tree] = [
        ("|", a, a),
        ("&", a, a),
        ("|", a, ("&", a, b)),
        ("&", a, ("|", a, b)),
        ("|", a, ("-", b, b)),
        ("-", a, ("-", b, ("|", b, a))),
        ("|", ("-", a, b), ("&", a, b)),
        ("-", a, ("-", b, a)),
    ]
    if not isinstance(a, int):
        operation, p, q = a
        ways += 4 * _shapes_of(operation, p, q)
    return ways[int(rng.integers(len(ways)))]


def _shapes_of(operation: str, p: Tree, q: Tree) -> list[Tree]:
    """What is commuted, associated, distributed, and by De Morgan."""
    found: list[Tree] = []
    if operation != "-":
        other = "&" if operation == "|" else "|"
        found.append((operation, q, p))
        if not isinstance(p, int) and p[0] == operation:
            found.append((operation, p[1], (operation, p[2], q)))
        if not isinstance(q, int) and q[0] == operation:
            found.append((operation, (operation, p, q[1]), q[2]))
        if not isinstance(q, int) and q[0] == other:
            found.append((other, (operation, p, q[1]), (operation, p, q[2])))
        return found
    if not isinstance(q, int):
        inner, r, s = q
        if inner == "|":
            found += [("&", ("-", p, r), ("-", p, s)), ("-", ("-", p, r), s)]
        elif inner == "&":
            found.append(("|", ("-", p, r), ("-", p, s)))
        else:
            found.append(("|", ("-", p, r), ("&", p, s)))
    if not isinstance(p, int) and p[0] == "-":
        found.append(("-", p[1], ("|", p[2], q)))
    return found


def rays_at(
    rng: np.random.Generator, n: int, middle: FloatArray, size: float
) -> tuple[FloatArray, FloatArray]:
    """From around, outside of everything, at points near the middle."""
    o = middle + 4.0 * size * unit_vectors(rng, n)
    return o, middle + size * rng.uniform(-1.0, 1.0, (n, 3)) - o
