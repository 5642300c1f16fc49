"""Ray-primitive intersections in exact arithmetic, which decide which tracer is right.

The numbers of rays and of table rows are floats, that is, exact rationals.  For one row of a table
of `reference_rt.shapes`, as a mapping of its columns (`columns_of(table)`, one row, or as many as
there are rays), and rays (n, 3) with directions of any length:

    hits = first_hit("spheres", row, origins, directions)
    hits.t          # (n,) the float nearest to the exact smallest t > 0, inf for a miss
    hits.low, hits.high   # floats that enclose the exact t: its neighbours
    hits.code       # (n,) the face, as the shape numbers its faces
    hits.touching   # (n,) the line passes exactly through an edge, or touches: hit or miss is right

    all_hits("tori", row, origins, directions)   # every crossing, of any sign of t: `Crossings`

Kinds are the fields of `reference_rt.shapes.Shapes`.  The surface is the one that the kernels
compute from the row.
A shape's own crossings stand in its file in `comparisons/shapes`, which `KINDS` is made of.  First
hits in a whole scene: `referee`, with the lengths of its shapes in `sizes`.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.crossings import Crossings, IntArray, Row
from comparisons.geometry.exact.dyadic import NEVER, BoolArray, Dyadic, Fixed, FloatArray, nearest
from comparisons.shapes import TABLES


def columns_of(table: Any) -> dict[str, Any]:
    """The columns of a shape's table by name; of triangles the vertices (n, 9), in place of points
    that triangles share."""
    columns: dict[str, Any] = table._asdict()
    if "corners" in columns:
        del columns["points"], columns["corners"]
        columns["vertices"] = table.vertices
    return columns


KINDS = {field: table.crossings for field, table in TABLES.items()}


class FirstHit(NamedTuple):
    """t, low, high, touching (n,): see the module;  code (n,): -1 for a miss;  fixed (n,): t as a
    fixed-point number with `dyadic.FRACTION` fractional bits."""

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
