"""The Mitsuba shapes that represent ours, and Mitsuba's hits in our numbering of shapes, faces and
uv.

Where Mitsuba lacks a shape, a mesh stands in for it: `StandIn` says how close that is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.mitsuba.scene import RawHits
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.query import Intersections

# ---- shapes --------------------------------------------------------------------------------------


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
    triangulate, over its longest side in uv if that is less than 1;  aspects: of
    triangles of a mesh that stands in, the longest side over the height on it;  uv_of_mesh: whether
    the vertices of such a mesh have our uv, which between them are interpolated.
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
    aspects: Callable[[IntArray], FloatArray] | None = None
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


# ---- hits ----------------------------------------------------------------------------------------


BoolArray = npt.NDArray[np.bool_]

AnyHits = TypeVar("AnyHits", bound=Intersections)


@dataclass(frozen=True)
class MitsubaHits(Intersections):
    """Mitsuba's hit records in our terms: `Intersections`, and for each hit:

    has_uv (n,): whether uv can be compared;  sag, turn (n,): the distance in scene units, and the
    angle in radians, by which the hit surface and its shading normal may differ from those of our
    shape, beyond float32's common bound;  stands_in (n,): whether the hit is on a mesh that stands
    in for a curved surface, and has the geometric normal of a flat triangle;  height (n,): the
    length of the hit triangle, in scene units, over which its normal and uv change, where a flat
    shape is a mesh in Mitsuba, of which our surface knows nothing; else infinite;  aspect (n,): the
    longest side of the hit triangle over its height, on a mesh that stands in for a curved surface;
    else 0.
    """

    has_uv: BoolArray
    sag: FloatArray
    turn: FloatArray
    stands_in: BoolArray
    height: FloatArray
    aspect: FloatArray

    @property
    def at_origin(self) -> BoolArray:
        """(n,): hits of rays in a plane through their own origins, at t = 0, which Mitsuba's scalar
        variants report; a ray of ours begins beyond t = 0."""
        return np.asarray((self.shape >= 0) & (self.t == 0.0))


CURVED = 4.0
"""Error bound of t, in units of u D² / r, where Mitsuba solves a quadratic in float32 for a surface
of radius r at the distance D: the discriminant is off by some u D².  Measured up to D / r = 100:
2.6 for Mitsuba's cylinders in llvm variants; 3.3 for its spheres in instances, whose quadratic is
better conditioned."""


def read(hits: RawHits, mi_shapes: Sequence[MitsubaShape], o: FloatArray) -> MitsubaHits:
    """The hits of rays from o in our terms; `hits.which` is an index of `mi_shapes`."""
    in_ours = misses(len(hits.t))
    met = hits.which >= 0
    for name in ("t", "p", "n", "ns"):
        getattr(in_ours, name)[:] = getattr(hits, name)
    in_ours.primitive[met] = hits.prim[met]
    order = np.argsort(hits.which, kind="stable")
    numbers, starts = np.unique(hits.which[order], return_index=True)
    for number, rows in zip(numbers.tolist(), np.split(order, starts[1:]), strict=True):
        if number < 0:
            continue
        mi_shape = mi_shapes[number]
        plugin = mi_shape.plugin
        in_ours.shape[rows], in_ours.part[rows] = mi_shape.shape, mi_shape.part
        in_ours.instance[rows] = mi_shape.instance
        if plugin.faces is not None:
            in_ours.primitive[rows] = plugin.faces[hits.prim[rows]]
        if plugin.uv is not None:
            uv = hits.uv[rows]
            in_ours.uv[rows] = uv if plugin.uv is same_uv else plugin.uv(uv)
            in_ours.has_uv[rows] = True
        elif plugin.uv_of_mesh:  # for textures; between vertices they are interpolated
            in_ours.uv[rows] = hits.uv[rows]
        in_ours.stands_in[rows] = plugin.faceted
        if plugin.heights is not None:
            in_ours.height[rows] = plugin.heights[hits.prim[rows]]
        if plugin.aspects is not None:
            in_ours.aspect[rows] = plugin.aspects(hits.prim[rows])
        if plugin.stand_in is not None:
            in_ours.sag[rows], in_ours.turn[rows] = plugin.stand_in.sag, plugin.stand_in.turn
            in_ours.stands_in[rows] = True
        if plugin.curved > 0.0:
            distance2 = np.sum((hits.p[rows] - o[rows]) ** 2, axis=1)
            in_ours.sag[rows] = CURVED * UNIT_ROUNDOFF * distance2 / plugin.curved
    return in_ours


def misses(n: int) -> MitsubaHits:
    """n misses."""
    none = [np.full(n, -1) for _ in range(4)]
    return MitsubaHits(
        t=np.full(n, np.inf),
        shape=none[0],
        primitive=none[1],
        part=none[2],
        instance=none[3],
        p=np.zeros((n, 3)),
        n=np.zeros((n, 3)),
        ns=np.zeros((n, 3)),
        uv=np.zeros((n, 2)),
        has_uv=np.zeros(n, bool),
        sag=np.zeros(n),
        turn=np.zeros(n),
        stands_in=np.zeros(n, bool),
        height=np.full(n, np.inf),
        aspect=np.zeros(n),
    )


def rows_of(hits: AnyHits, rows: Any) -> AnyHits:
    """The hits of some rows."""
    return type(hits)(**{name: array[rows] for name, array in vars(hits).items()})


def assign(hits: AnyHits, rows: Any, some: AnyHits) -> None:
    """Overwrite the hits of `rows` with `some`."""
    for name, array in vars(some).items():
        getattr(hits, name)[rows] = array


def assign_nearer(hits: MitsubaHits, rows: IntArray, some: MitsubaHits) -> None:
    """Overwrite those hits of `rows` for which `some` is nearer."""
    nearer = some.t < hits.t[rows]
    assign(hits, rows[nearer], rows_of(some, nearer))
