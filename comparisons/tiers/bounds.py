"""How far float32 may move what Mitsuba finds: the error bounds of every rung.

All follow from one length, `delta`: how far a surface that Mitsuba sees, in float32, may lie from
where it is, as seen along a ray from `o` to `p`.
"""

from dataclasses import dataclass

import numpy as np

from reference_rt.shapes import TABLES
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.tables import SceneTables

UNIT_ROUNDOFF = 2.0**-24
"""u of float32."""

ROUNDINGS = 8.0
"""Units of roundoff that a hit may be off by.  On its way are some 16 roundings: the matrix's entry
(1), its product with a local point (4), vertex minus origin (1), the intersection's products, sums
and quotient (5 to 7), o + t d or the barycentric sum (3).  Signs are as good as random, so that
they add up as a square root (Higham & Mary 2019): 4, times sqrt(3) from components to lengths.
Measured on the test scenes, in both variants: at most 2.6."""


def round32(array: FloatArray) -> FloatArray:
    """The nearest float32 values: rays that both tracers can hold exactly."""
    return array.astype(np.float32).astype(np.float64)


def largest(vectors: FloatArray) -> FloatArray:
    """The largest component of each of (n, 3)."""
    return np.asarray(np.abs(vectors).max(axis=1))


@dataclass(frozen=True)
class ShapeSizes:
    """Lengths of a scene's shapes, for bounds.

    reach (shapes,): the largest coordinate on each shape;  first (shapes,), feature (primitives,):
    feature[first[shape] + face] is the smallest length of a face, over which its coordinates and
    its normal change: a radius, the smallest height of a triangle or a rectangle;  lower, upper
    (3,): the scene's bounds.
    """

    reach: FloatArray
    first: IntArray
    feature: FloatArray
    lower: FloatArray
    upper: FloatArray

    def reach_of(self, shape: IntArray) -> FloatArray:
        """(n,): 0 for no shape."""
        return np.asarray(np.append(self.reach, 0.0)[shape])

    def feature_of(self, shape: IntArray, face: IntArray) -> FloatArray:
        """(n,): infinite for no shape."""
        hit = shape >= 0
        index = np.where(hit, self.first[shape] + np.maximum(face, 0), 0)
        return np.where(hit, self.feature[index], np.inf)


def shape_sizes(tables: SceneTables, shapes: int) -> ShapeSizes:
    """The lengths of a scene of `shapes` shapes."""
    reach, faces = np.zeros(shapes + 1), np.ones(shapes + 1, np.int64)
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    parts = []
    for _, field, _, module in TABLES:
        table = getattr(tables.geometry.shapes, field)
        if table is None:
            continue
        low, high = module.bounds(table)
        lower, upper = np.minimum(lower, low.min(axis=0)), np.maximum(upper, high.max(axis=0))
        np.maximum.at(reach, table.owner, np.maximum(largest(low), largest(high)))
        feature = _features(field, table)
        face = np.tile(np.arange(feature.shape[1]), (len(feature), 1)) + table.face[:, None]
        owner = np.tile(table.owner[:, None], (1, feature.shape[1]))
        np.maximum.at(faces, owner, face + 1)
        parts.append((owner.ravel(), face.ravel(), feature.ravel()))
    first = np.cumsum(faces) - faces
    flat = np.full(int(faces.sum()), np.inf)
    for owner, face, feature in parts:
        flat[first[owner] + face] = feature
    return ShapeSizes(reach[:-1], first, flat, lower, upper)


def _features(field: str, table: object) -> FloatArray:
    """(rows, faces of a row): the smallest length of each face."""
    data = fields_of(table)
    if field == "spheres":
        return np.asarray(data["radius"][:, None])
    if field == "rectangles":
        heights = [2.0 / np.linalg.norm(data[k], axis=1) for k in ("x_of", "y_of")]
        return np.asarray(np.min(heights, axis=0)[:, None])
    if field == "boxes":
        heights = 2.0 / np.linalg.norm(data["to_local"].reshape(-1, 3, 3), axis=2)
        return np.tile(heights.min(axis=1)[:, None], (1, 6))
    v = data["vertices"].reshape(-1, 3, 3)
    edges = np.linalg.norm(v - np.roll(v, 1, axis=1), axis=2).max(axis=1)
    double_area = np.linalg.norm(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]), axis=1)
    height = np.divide(double_area, edges, out=np.zeros_like(edges), where=edges > 0.0)
    return np.asarray(height[:, None])


def fields_of(table: object) -> dict[str, FloatArray]:
    """The fields of a table, which is a NamedTuple."""
    return dict(table._asdict())  # type: ignore[attr-defined]


def delta(o: FloatArray, p: FloatArray, reach: FloatArray) -> FloatArray:
    """(n,): how far float32 may move a surface: ROUNDINGS u (|o| + |p| + the shape's reach)."""
    return ROUNDINGS * UNIT_ROUNDOFF * (largest(o) + largest(p) + reach)


def slide(
    sizes: ShapeSizes, o: FloatArray, d: FloatArray, p: FloatArray, n: FloatArray, shape: IntArray
) -> FloatArray:
    """(n,): how far the point that a ray finds may slide: delta over the ray's cosine to n."""
    cosine = np.abs(np.sum(d * n, axis=1)) / np.linalg.norm(d, axis=1)
    with np.errstate(divide="ignore"):
        return np.asarray(delta(o, p, sizes.reach_of(shape)) / cosine)
