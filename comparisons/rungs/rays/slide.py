"""The error bound of a hit point, which the bounds of all rungs follow from."""

import numpy as np

from comparisons.referee.sizes import ShapeSizes
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.query import Intersections


def slide(
    sizes: ShapeSizes,
    o: FloatArray,
    d: FloatArray,
    hits: Intersections,
    sag: FloatArray | float = 0.0,
) -> FloatArray:
    """(n,): how far a hit may slide along its ray and its surface: `Frame.delta`, the distance by
    which float32 moves the surface, plus `sag`, the error of a mesh that stands in for it, over
    the ray's cosine to n."""
    cosine = np.abs(np.sum(d * hits.n, axis=1)) / np.linalg.norm(d, axis=1)
    with np.errstate(divide="ignore"):
        size = sizes.frame.delta(o, hits.p, sizes.reach_of(hits.shape)) + sag
        return np.asarray(size / cosine)
