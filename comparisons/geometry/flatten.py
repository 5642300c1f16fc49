"""A scene as primitives: its groups, instances and solids expanded.

It is made from the description alone, not from our tables: their expansion of nested groups and CSG
trees is under test too.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.affine import Affine
from reference_rt.rendering.scene import Scene
from reference_rt.shapes.csg import Difference, Solid, Union
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Shape, TabulationContext


class Leaf(NamedTuple):
    """A primitive shape: its description;  outer: the map applied after its own transform;  the
    name of its material;  part: its number in its solid, or in its group, where the operands of
    solids count one by one;  interior, exterior: the names of the media that it bounds, or that its
    solid does."""

    shape: Shape
    outer: Affine
    material: str | None
    part: int
    interior: str | None = None
    exterior: str | None = None


class Tree(NamedTuple):
    """A CSG tree: the operation ("union", "intersection" or "difference"), and its operands: trees,
    or numbers of leaves."""

    operation: str
    of: tuple["Tree | int", ...]


class Member(NamedTuple):
    """A shape of the scene or of a group: one leaf, or the leaves of a solid and its CSG tree."""

    leaves: tuple[Leaf, ...]
    tree: Tree | None


class Copy(NamedTuple):
    """A shape, or one instance of a group, in the scene.

    shape: index in the scene;  instance: number of the instance, -1 for a plain shape;  group: the
    group's name, "" for a plain shape;  members: in the group's coordinates;  outer: the map to
    scene coordinates.
    """

    shape: int
    instance: int
    group: str
    members: tuple[Member, ...]
    outer: Affine


def place_of(scene: Scene, leaf: Leaf, outer: Affine) -> TabulationContext:
    """The place with which a leaf is tabulated;  outer: the map of its group to the scene."""
    return TabulationContext(folder=scene.folder, outer=affine.compose(leaf.outer, outer))


def copies_of(scene: Scene) -> list[Copy]:
    """Everything that rays can hit.  A nested group expands to its own shapes first, then to those
    of its instances, in order."""
    groups = {name: tuple(_members(shapes)) for name, shapes in scene.groups.items()}
    found: list[Copy] = []
    for i, shape in enumerate(scene.shapes):
        if isinstance(shape, Instance):
            expanded = _expanded(scene, shape, affine.IDENTITY)
            found += [Copy(i, k, g, groups[g], m) for k, (g, m) in enumerate(expanded)]
        else:
            found.append(Copy(i, -1, "", (member_of(shape, 0),), affine.IDENTITY))
    return found


def _members(shapes: Sequence[Shape]) -> Iterator[Member]:
    """The members of a group."""
    number = 0
    for shape in shapes:
        if isinstance(shape, Instance):
            number += 1
        else:
            member = member_of(shape, number)
            number += len(member.leaves)
            yield member


def _expanded(scene: Scene, instance: Instance, outer: Affine) -> Iterator[tuple[str, Affine]]:
    """(group, map to the scene) of each copy that an instance expands to."""
    shapes = scene.groups[instance.group]
    for own in maps_of(instance, scene.folder):
        inner = affine.compose(own, outer)
        if not all(isinstance(shape, Instance) for shape in shapes):
            yield instance.group, inner
        for shape in shapes:
            if isinstance(shape, Instance):
                yield from _expanded(scene, shape, inner)


def maps_of(instance: Instance, folder: Path) -> list[Affine]:
    """The maps of an instance's copies."""
    own = affine.of_steps(instance.transform)
    if instance.file is None:
        return [own]
    maps = np.load(folder / instance.file).astype(np.float64)
    return [affine.compose(m[:3], own) for m in maps]


def member_of(shape: Shape, number: int) -> Member:
    """The member for a shape that is no instance;  number: of its first leaf in its group."""
    if not isinstance(shape, Solid):
        sides = shape.interior, shape.exterior
        leaf = Leaf(shape, affine.IDENTITY, shape.material, number, *sides)
        return Member((leaf,), None)
    leaves: list[Leaf] = []
    tree = _tree(shape, affine.IDENTITY, None, leaves)
    assert isinstance(tree, Tree)
    inner, outer = shape.interior, shape.exterior
    placed = (
        leaf._replace(part=number + leaf.part, interior=inner, exterior=outer) for leaf in leaves
    )
    return Member(tuple(placed), tree)


def _tree(shape: Shape, outer: Affine, material: str | None, leaves: list[Leaf]) -> Tree | int:
    """The CSG tree of a shape; appends its operands to `leaves`, from left to right."""
    material = shape.material if shape.material is not None else material
    if not isinstance(shape, Solid):
        leaves.append(Leaf(shape, outer, material, len(leaves)))
        return len(leaves) - 1
    outer = affine.compose(affine.of_steps(shape.transform), outer)
    of = tuple(_tree(operand, outer, material, leaves) for operand in shape.of)
    if isinstance(shape, Difference):
        return Tree("difference", of)
    return Tree("union" if isinstance(shape, Union) else "intersection", of)
