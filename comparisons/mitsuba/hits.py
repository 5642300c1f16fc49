"""What Mitsuba's hits are in our terms."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from comparisons.geometry.float32 import UNIT_ROUNDOFF
from comparisons.mitsuba.scene import Hits
from comparisons.mitsuba.stand_ins import Piece, same_uv
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.query import Intersections

BoolArray = npt.NDArray[np.bool_]

AnyHits = TypeVar("AnyHits", bound=Intersections)


@dataclass(frozen=True)
class Answers(Intersections):
    """Intersections, and for each: has_uv, whether its uv mean what ours do;  sag, turn (n,): how
    far the surface that was hit, and its shading normal, may be from those of the shape that it
    stands for, in scene units and radians, beyond float32's common bound;  stands_in: whether it is
    a mesh for a curved surface, whose geometric normals are those of flat triangles."""

    has_uv: BoolArray
    sag: FloatArray
    turn: FloatArray
    stands_in: BoolArray


CURVED = 4.0
"""A quadratic's discriminant, solved in float32 for a surface of radius r at the distance D, is
off by some u D²: t by this many times u D² / r at most.  Measured for Mitsuba's cylinders in llvm
variants, up to D / r = 100: 2.6; for its spheres, whose quadratic is a better one, within
instances: 3.3."""


def read(hits: Hits, pieces: Sequence[Piece], o: FloatArray) -> Answers:
    """The hits of rays from o in our terms; `hits.which` counts the pieces."""
    found = nothing(len(hits.t))
    met = hits.which >= 0
    for name in ("t", "p", "n", "ns"):
        getattr(found, name)[:] = getattr(hits, name)
    found.primitive[met] = hits.prim[met]
    order = np.argsort(hits.which, kind="stable")
    numbers, starts = np.unique(hits.which[order], return_index=True)
    for number, rows in zip(numbers.tolist(), np.split(order, starts[1:]), strict=True):
        if number < 0:
            continue
        piece = pieces[number]
        plugin = piece.plugin
        found.shape[rows], found.part[rows] = piece.shape, piece.part
        found.instance[rows] = piece.instance
        if plugin.faces is not None:
            found.primitive[rows] = plugin.faces[hits.prim[rows]]
        if plugin.uv is not None:
            uv = hits.uv[rows]
            found.uv[rows] = uv if plugin.uv is same_uv else plugin.uv(uv)
            found.has_uv[rows] = True
        found.stands_in[rows] = plugin.faceted
        if plugin.stand_in is not None:
            found.sag[rows], found.turn[rows] = plugin.stand_in.sag, plugin.stand_in.turn
            found.stands_in[rows] = True
        if plugin.curved > 0.0:
            distance2 = np.sum((hits.p[rows] - o[rows]) ** 2, axis=1)
            found.sag[rows] = CURVED * UNIT_ROUNDOFF * distance2 / plugin.curved
    return found


def nothing(n: int) -> Answers:
    """n misses."""
    none = [np.full(n, -1) for _ in range(4)]
    return Answers(
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
    )


def rows_of(hits: AnyHits, rows: Any) -> AnyHits:
    """Some of the hits."""
    return type(hits)(**{name: array[rows] for name, array in vars(hits).items()})


def put(hits: AnyHits, rows: Any, some: AnyHits) -> None:
    """Writes `some` over the hits that `rows` names."""
    for name, array in vars(some).items():
        getattr(hits, name)[rows] = array


def put_nearer(hits: Answers, rows: IntArray, some: Answers) -> None:
    """Writes those of `some` that are nearer than the hits at `rows`."""
    nearer = some.t < hits.t[rows]
    put(hits, rows[nearer], rows_of(some, nearer))
