"""The Mitsuba shapes that stand for ours, and how to read their hits."""

from collections.abc import Callable
from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray

UvMap = Callable[[FloatArray], FloatArray]
"""Mitsuba's uv (n, 2) of a shape -> ours."""


class StandIn(NamedTuple):
    """How close a mesh is to the surface that it stands for.

    name: of the shape;  triangles: their number;  sag: the largest distance between them, in scene
    units;  turn: the largest angle between their normals, in radians;  ratio: how many times
    larger the sag is with half as many triangles along each side.
    """

    name: str
    triangles: int
    sag: float
    turn: float
    ratio: float


class Extent(NamedTuple):
    """A disk, all that there is of an infinite plane: middle (3,) and radius."""

    middle: FloatArray
    radius: float


class Plugin(NamedTuple):
    """One of Mitsuba's shapes.

    value: its dict, or the object;  suffix: of its id;  faces: our numbers of its primitives, None
    where they are the same;  uv: how its uv become ours, None where the two have nothing in common;
    stand_in: for a mesh in place of a surface that Mitsuba does not have;  extent: what it is of an
    infinite plane;  within: of an instance;  curved: the radius of a surface whose equation Mitsuba
    solves in float32 (see `answers.read`), 0 for none;  faceted: whether it is so many small
    triangles that float32 turns their own normals: those of the corners tell the surface's.
    """

    value: Any
    suffix: str = ""
    faces: IntArray | None = None
    uv: UvMap | None = None
    stand_in: StandIn | None = None
    extent: Extent | None = None
    within: "Within | None" = None
    curved: float = 0.0
    faceted: bool = False


class Within(NamedTuple):
    """What an instance holds: the id of the group;  member: the dict of the one Mitsuba shape in
    it, or a function that makes the object in the variant that is set."""

    name: str
    member: Any


class Piece(NamedTuple):
    """A Mitsuba shape that stands for a leaf, or for part of one, of our scene.

    shape, part, instance: as in `Intersections`;  leaf: its description;  plugin: how to read its
    hits.
    """

    shape: int
    part: int
    instance: int
    leaf: Any
    plugin: Plugin


def same_uv(uv: FloatArray) -> FloatArray:
    """Mitsuba's uv are ours."""
    return uv
