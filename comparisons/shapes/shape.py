"""What the comparison knows of a type of shapes: `ShapeType`, one per type, in the type's file.

mypy names the fields that a new type lacks.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from comparisons.geometry.affine import IDENTITY, Affine
from comparisons.geometry.exact.crossings import Crossings, Row
from comparisons.geometry.exact.dyadic import Dyadic
from comparisons.mitsuba.hits import Plugin
from comparisons.mitsuba.node import Node, Reading
from comparisons.shapes.site import Site
from comparisons.shapes.soup import Soup
from comparisons.shapes.surface import Surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes.shape import Shape

Features = Callable[[FloatArray, IntArray], FloatArray]
"""Points (n, 3) in the coordinates of a table's group, and the faces (n,) that they are on -> (n,):
the smallest lengths over which uv or normal change there."""


def per_face(lengths: FloatArray) -> Features:
    """Lengths that each face has, or that all have if there is one."""
    return lambda p, faces: np.asarray(lengths[np.clip(faces, 0, len(lengths) - 1)])


@dataclass(frozen=True, kw_only=True)
class TableType:
    """What is known of the rows of a table, by their numbers.

    field: that of `reference_rt.shapes.Shapes`;  crossings: where lines (n, 3) cross a row,
    exactly: the surface is the one that the kernels compute from the row, from center, normal,
    radius, vertices, or from to_local and the unit shape;  features: of one shape's table;  bends:
    the same of its normals alone, None where that is no longer;  targets: corners and middles of
    edges (n, 3) of one shape's table, where rays are aimed;  near: of a table of many rows, those
    that a line may cross, conservatively, in floats.
    """

    field: str
    crossings: Callable[[Row, Dyadic, Dyadic], Crossings]
    features: Callable[[Any], Features]
    bends: Callable[[Any], Features] | None = None
    targets: Callable[[Any], FloatArray] = lambda table: np.zeros((0, 3))
    near: Callable[[Row, FloatArray, FloatArray], IntArray] | None = None


class PbrtPart(NamedTuple):
    """A shape of pbrt's;  place: the map of its own coordinates to the world;  reversed: whether
    its normal is turned round."""

    place: Affine
    plugin: str
    params: dict[str, Any]
    reversed: bool = False


class RaysectPart(NamedTuple):
    """A primitive of raysect's: its type, lengths, and its place in the shape's own coordinates;
    see `comparisons.raysect.worker`.  Or "half_space", what is below z = 0."""

    type: str
    sizes: tuple[float, ...]
    place: Affine = IDENTITY


class PovShape(NamedTuple):
    """An object of POV-Ray's, before its map and texture and the brace that closes it;  place: the
    map to the shape's own coordinates.  It is about 1 large: POV-Ray's epsilons are absolute."""

    text: str
    place: Affine = IDENTITY


def pov_size(lengths: Any) -> float:
    """A power of two that is about as large as the largest of some lengths, of either sign."""
    return float(2.0 ** np.ceil(np.log2(np.abs(lengths).max())))


def pov_points(points: FloatArray) -> tuple[FloatArray, Affine]:
    """Points (n, 3) around 0 and about 1 large, and their place."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size = pov_size(points - middle)
    return (points - middle) / size, np.column_stack([size * np.eye(3), middle])


class PbrtPlace(NamedTuple):
    """place: the map, without its scale where it keeps angles;  size: that scale, else 1;
    mirrored;  textured: whether the material depends on uv."""

    place: Affine
    size: float
    mirrored: bool
    textured: bool


AnyShape = TypeVar("AnyShape", bound=Shape)

Reader = Callable[[Reading, Node, "str | None"], Shape]
"""Reads an element of Mitsuba's; the name is that of its material."""

Tessellation = tuple[list[Soup], float]
"""The parts of a shape in its own coordinates, and how far they are off it under its own map."""


OwnPlugin = tuple[str, dict[str, Any]]
"""The name of a plugin of Mitsuba's, and its values beside `to_world`."""


def never(shape: Any) -> bool:
    return False


def always(shape: Any) -> bool:
    return True


def is_capped(shape: Any) -> bool:
    return bool(shape.capped)


@dataclass(frozen=True, kw_only=True)
class ShapeType(Generic[AnyShape]):
    """A type of shapes.  None stands where a type has none.

    A test holds that `SHAPES` has a row for each member of our `Primitive`.
    """

    of: type[AnyShape]
    table: TableType | None
    """None: the rows are of another's table."""
    surface: Callable[[AnyShape], Surface] | None
    """Its equation in its own space.  None: triangles, or made of them."""
    to_mitsuba: Callable[[AnyShape, Site], list[Plugin]]
    """The Mitsuba shapes that represent one, in order.  Raises UntranslatableError, and ValueError
    for a file that cannot be used."""
    triangles: Callable[[AnyShape, Affine], Tessellation] | None
    """With our uv.  None: infinite, or triangles already."""
    encloses: Callable[[AnyShape], bool]
    """Whether one is a solid."""
    from_mitsuba: Mapping[str, Reader] = field(default_factory=dict)
    """By Mitsuba's plugin."""
    own_plugin: Callable[[AnyShape, FloatArray, bool], OwnPlugin | None] | None = None
    """The shape as Mitsuba's of its kind under a linear map (3, 3), where a scene file can have it;
    the flag tells whether its material depends on uv."""
    unwrapped: Callable[[FloatArray], FloatArray] | None = None
    """uv (n, 2) of its face 0 as coordinates (n, 3) without seam or pole."""
    to_cycles: Callable[[AnyShape, Path], Soup] | None = None
    """Its triangles before its transform for Cycles, which has no curved shapes."""
    to_pbrt: Callable[[AnyShape, PbrtPlace], list[PbrtPart]] | None = None
    """pbrt's own shapes; none where triangles must stand for it."""
    to_raysect: Callable[[AnyShape], list[RaysectPart]] | None = None
    """raysect's primitives whose intersection it is.  Raises NoCounterpartError."""
    to_povray: Callable[[AnyShape, Path], PovShape] | None = None
    """Raises NoCounterpartError."""
    flat_uv: Affine | None = None
    """Of a flat shape the map from (u, v, 0) to its own coordinates."""
    is_sampled: bool = False
    """Whether `reference_rt` samples points of one that is a lamp."""
