"""The Mitsuba shapes that represent our shapes, and how to convert their hits.

Where Mitsuba lacks a shape, a mesh stands in for it: `StandIn` says how close that is.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray

UvMap = Callable[[FloatArray], FloatArray]
"""Mitsuba's uv (n, 2) of a shape -> our uv."""


class StandIn(NamedTuple):
    """The error of a mesh that stands in for a curved surface.

    name: of the shape;  triangles: their number;  sag: the largest distance between mesh and
    surface, in scene units;  turn: the largest angle between their normals, in radians;  ratio: the
    sag of a mesh with half as many triangles along each side, over this one's;  slip: the largest
    distance, in scene units, by which uv are shifted, as the mesh interpolates them;  shift: the
    same of what the material sees, whose uv may be exact;  twist: the angle between the material's
    tangents, in radians, that is exceeded on a thousandth of the area, where it depends on them,
    else 0.
    """

    name: str
    triangles: int
    sag: float
    turn: float
    ratio: float
    slip: float = 0.0
    shift: float = 0.0
    twist: float = 0.0


class Extent(NamedTuple):
    """The disk inside the mesh that stands in for an infinite plane: middle (3,) and radius."""

    middle: FloatArray
    radius: float


class Plugin(NamedTuple):
    """The translation of a shape, or of a part of one, to a Mitsuba shape.

    value: its dict, or the object;  suffix: of its id;  faces: our numbers of its primitives, None
    if they are the same;  uv: its uv -> ours, None if they cannot be converted;  stand_in: the
    error of a mesh that stands in for a surface that Mitsuba lacks;  extent: of a mesh that stands
    in for an infinite plane;  group: the group of an instance;  curved: the radius of a surface
    whose quadratic Mitsuba solves in float32 (see `hits.CURVED`), else 0;  faceted: whether its
    triangles are so small that float32 turns their geometric normals, so that shading normals are
    compared;  heights: the smallest height of each triangle of a flat shape that we do not
    triangulate, over its longest side in uv if that is less than 1;  aspects: the longest side of
    each triangle of a mesh that stands in, over its height on it;  uv_of_mesh: whether the vertices
    of such a mesh have our uv, which between them are interpolated.
    """

    value: Any
    suffix: str = ""
    faces: IntArray | None = None
    uv: UvMap | None = None
    stand_in: StandIn | None = None
    extent: Extent | None = None
    group: "ShapeGroup | None" = None
    curved: float = 0.0
    faceted: bool = False
    heights: FloatArray | None = None
    aspects: FloatArray | None = None
    uv_of_mesh: bool = False

    @property
    def has_our_uv(self) -> bool:
        """Whether textures see our uv."""
        return self.uv is same_uv or self.uv_of_mesh


class ShapeGroup(NamedTuple):
    """The Mitsuba `shapegroup` of an instance: its id;  member: the dict of the one Mitsuba shape
    in it, or a function that makes the object in the current variant."""

    name: str
    member: Any


class MitsubaShape(NamedTuple):
    """A Mitsuba shape in a loaded scene, and the primitive of our scene that it represents, or a
    part of one.

    shape, part, instance: as in `Intersections`;  leaf: the primitive's description;  plugin: how
    to convert its hits.
    """

    shape: int
    part: int
    instance: int
    leaf: Any
    plugin: Plugin


def same_uv(uv: FloatArray) -> FloatArray:
    """The `UvMap` of shapes whose uv are the same in Mitsuba."""
    return uv
