"""How far float32 may move what Mitsuba finds: the length behind every bound."""

import numpy as np

from reference_rt.core.arrays import FloatArray

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


def delta(o: FloatArray, p: FloatArray, reach: FloatArray) -> FloatArray:
    """(n,): how far float32 may move a surface, seen along a ray from o to p:
    ROUNDINGS u (|o| + |p| + the shape's reach)."""
    return ROUNDINGS * UNIT_ROUNDOFF * (largest(o) + largest(p) + reach)
