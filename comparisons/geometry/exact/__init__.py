"""Exact arithmetic as the judge: where rays meet primitives, certified.

The numbers of rays and of table rows are floats, and so are exact rationals.  For one row of a
table of `reference_rt.shapes`, as a mapping of its columns (`table._asdict()`, of one row, or of as
many as there are rays), and rays (n, 3), of any length:

    hits = first_hit("spheres", row, origins, directions)
    hits.t          # (n,) the float nearest to the exact smallest t > 0, inf for a miss
    hits.low, hits.high   # floats that enclose the exact t: its neighbours
    hits.code       # (n,) the face, as `face_of` of the shape says it
    hits.touching   # (n,) the line runs exactly through an edge, or touches: either answer is right

    all_hits("tori", row, origins, directions)   # every crossing, of any sign of t: `Crossings`

Kinds are the fields of `reference_rt.shapes.Shapes`.  What a row's numbers mean is what its kernels
compute from them: t comes from center, normal, radius, vertices, or from to_local and, in local
coordinates, the unit shape.  Everything is decided on Python's integers, which never overflow, a
whole array at a time: some 5 µs a ray; the quartics of tori by FLINT, some 100 µs.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact import curved, flat
from comparisons.geometry.exact.crossings import Crossings, IntArray, Row
from comparisons.geometry.exact.dyadic import NEVER, BoolArray, Dyadic, Fixed, FloatArray, nearest

KINDS: dict[str, Callable[[Row, Dyadic, Dyadic], Crossings]] = {
    "spheres": curved.spheres,
    "rectangles": flat.rectangles,
    "boxes": curved.boxes,
    "triangles": flat.triangles,
    "disks": flat.disks,
    "planes": flat.planes,
    "polygons": flat.polygons,
    "quadrics": curved.quadrics,
    "tori": curved.tori,
}


class FirstHit(NamedTuple):
    """t, low, high (n,): see the module;  code (n,): -1 for a miss;  touching (n,);  fixed (n,): t
    as a fixed-point number of `dyadic.FRACTION` bits."""

    t: FloatArray
    low: FloatArray
    high: FloatArray
    code: IntArray
    touching: BoolArray
    fixed: Fixed


def all_hits(kind: str, row: Row, o: npt.ArrayLike, d: npt.ArrayLike) -> Crossings:
    """Every crossing of the rays' lines with one primitive, over all t."""
    origins, directions = (np.atleast_2d(np.asarray(x, np.float64)) for x in (o, d))
    return KINDS[kind](row, Dyadic.of(origins), Dyadic.of(directions))


def first_hit(kind: str, row: Row, o: npt.ArrayLike, d: npt.ArrayLike) -> FirstHit:
    """The first crossing of each ray with one primitive beyond t = 0."""
    return first_of(all_hits(kind, row, o, d))


def first_of(crossings: Crossings) -> FirstHit:
    """The first crossing beyond t = 0."""
    ahead = np.where(crossings.t > 0, crossings.t, NEVER)
    k = np.argmin(ahead, axis=1)[:, None]
    fixed = np.take_along_axis(ahead, k, axis=1)[:, 0]
    code = np.take_along_axis(crossings.code, k, axis=1)[:, 0]
    t = nearest(fixed)
    hit = np.isfinite(t)
    low, high = np.nextafter(t, -np.inf), np.nextafter(t, np.inf)
    return FirstHit(
        t,
        np.where(hit, low, np.inf),
        np.where(hit, high, np.inf),
        np.where(hit, code, -1),
        crossings.touching,
        fixed,
    )


__all__ = ["KINDS", "Crossings", "FirstHit", "all_hits", "first_hit", "first_of"]
