"""Mitsuba's hits, converted to our numbering of shapes, faces and uv."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from comparisons.geometry.float32 import UNIT_ROUNDOFF
from comparisons.mitsuba.scene import RawHits
from comparisons.mitsuba.stand_ins import MitsubaShape, same_uv
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.query import Intersections

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
    found = misses(len(hits.t))
    met = hits.which >= 0
    for name in ("t", "p", "n", "ns"):
        getattr(found, name)[:] = getattr(hits, name)
    found.primitive[met] = hits.prim[met]
    order = np.argsort(hits.which, kind="stable")
    numbers, starts = np.unique(hits.which[order], return_index=True)
    for number, rows in zip(numbers.tolist(), np.split(order, starts[1:]), strict=True):
        if number < 0:
            continue
        mi_shape = mi_shapes[number]
        plugin = mi_shape.plugin
        found.shape[rows], found.part[rows] = mi_shape.shape, mi_shape.part
        found.instance[rows] = mi_shape.instance
        if plugin.faces is not None:
            found.primitive[rows] = plugin.faces[hits.prim[rows]]
        if plugin.uv is not None:
            uv = hits.uv[rows]
            found.uv[rows] = uv if plugin.uv is same_uv else plugin.uv(uv)
            found.has_uv[rows] = True
        elif plugin.uv_of_mesh:  # for textures; between vertices they are interpolated
            found.uv[rows] = hits.uv[rows]
        found.stands_in[rows] = plugin.faceted
        if plugin.heights is not None:
            found.height[rows] = plugin.heights[hits.prim[rows]]
        if plugin.aspects is not None:
            found.aspect[rows] = plugin.aspects[hits.prim[rows]]
        if plugin.stand_in is not None:
            found.sag[rows], found.turn[rows] = plugin.stand_in.sag, plugin.stand_in.turn
            found.stands_in[rows] = True
        if plugin.curved > 0.0:
            distance2 = np.sum((hits.p[rows] - o[rows]) ** 2, axis=1)
            found.sag[rows] = CURVED * UNIT_ROUNDOFF * distance2 / plugin.curved
    return found


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
