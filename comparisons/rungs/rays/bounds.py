"""The error bounds of every rung.

All follow from one length, `delta`: how far a surface that Mitsuba sees, in float32, may lie from
where it is, as seen along a ray from `o` to `p`.
"""

import numpy as np

from comparisons.geometry.float32 import ROUNDINGS, UNIT_ROUNDOFF, largest, round32
from comparisons.geometry.sizes import LeafSizes, ShapeSizes
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.query import Intersections


def slide(
    sizes: ShapeSizes,
    o: FloatArray,
    d: FloatArray,
    hits: Intersections,
    sag: FloatArray | float = 0.0,
) -> FloatArray:
    """(n,): how far the point that a ray finds may slide: delta, and how far the surface is from
    the one it stands for, over the ray's cosine to n."""
    cosine = np.abs(np.sum(d * hits.n, axis=1)) / np.linalg.norm(d, axis=1)
    with np.errstate(divide="ignore"):
        size = sizes.frame.delta(o, hits.p, sizes.reach_of(hits.shape)) + sag
        return np.asarray(size / cosine)


__all__ = [
    "ROUNDINGS",
    "UNIT_ROUNDOFF",
    "LeafSizes",
    "ShapeSizes",
    "largest",
    "round32",
    "slide",
]
