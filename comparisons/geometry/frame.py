"""The frame of a scene's counterpart in Mitsuba: moved and scaled where float32 needs it.

Mitsuba starts rays that leave a surface (1 + max |p|) RAY_EPSILON off it.  A scene far from the
origin, or a small one, loses everything thinner than that.  Its counterpart is then moved to the
origin and scaled to unit size; rays are mapped into this frame, and their hits back."""

import math
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF as UNIT_ROUNDOFF_64

# ---- the error bound of hit points in float32, the basis of all other bounds ---------------------


UNIT_ROUNDOFF = 2.0**-24
"""u of float32: half a unit in the last place of 1."""

ROUNDINGS = 8.0
"""Error bound of a hit in units of roundoff.  It is computed with some 16 roundings: the matrix's
entry (1), its product with a local point (4), vertex minus origin (1), the intersection's products,
sums and quotient (5 to 7), o + t d or the barycentric sum (3).  Their signs are practically random,
so that they add up as a square root (Higham & Mary 2019): 4, times sqrt(3) from components to
lengths.  Measured on the test scenes, in both variants: at most 2.6."""


def round32(array: FloatArray) -> FloatArray:
    """The nearest float32 values, which both tracers represent exactly."""
    return array.astype(np.float32).astype(np.float64)


def largest(vectors: FloatArray) -> FloatArray:
    """(n,): the largest absolute component of each vector (n, 3)."""
    return np.asarray(np.abs(vectors).max(axis=1))


def delta(o: FloatArray, p: FloatArray, reach: FloatArray) -> FloatArray:
    """(n,): how far float32 may move a surface, seen along a ray from o to p:
    ROUNDINGS u (|o| + |p| + reach), with reach the largest coordinate on the shape."""
    return ROUNDINGS * UNIT_ROUNDOFF * (largest(o) + largest(p) + reach)


RAY_EPSILON = 1500.0 * 2.0**-24
"""Mitsuba's `math::RayEpsilon`: rays that leave a surface start (1 + max |p|) times this off it."""

SHADOW_EPSILON = 10.0 * RAY_EPSILON
"""Mitsuba's `math::ShadowEpsilon`: shadow rays end this fraction of their length early."""

SHARE = 0.01
"""Largest offset of rays from surfaces, as a fraction of the scene's half size, before the
counterpart is moved: details smaller than the offset are invisible from neighbouring surfaces.  The
same hundredth as `arbiter.LIMIT`: beyond it the comparison measures Mitsuba's precision."""


class Frame(NamedTuple):
    """The counterpart's coordinates are (p - center) scale: center has few digits and scale is a
    power of two, so that the map is exact, or rounds by less than the spacing of float64 at p."""

    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0

    @property
    def is_ours(self) -> bool:
        """Whether the counterpart has our scene's coordinates."""
        return self == OURS

    def into(self, p: FloatArray) -> FloatArray:
        """Points (n, 3) of the scene in the counterpart's coordinates."""
        return p if self.is_ours else np.asarray((p - self.center) * self.scale)

    def out(self, p: FloatArray) -> FloatArray:
        """Points (n, 3) of the counterpart in the scene's coordinates."""
        return p if self.is_ours else np.asarray(p / self.scale + self.center)

    def rounded(self, p: FloatArray) -> FloatArray:
        """The nearest points (n, 3) that are exact in float32 in the counterpart's coordinates."""
        return self.out(round32(self.into(p)))

    def largest(self, p: FloatArray) -> FloatArray:
        """(n,): the largest coordinate of points (n, 3), counted from the counterpart's origin, in
        scene units."""
        return largest(p) if self.is_ours else largest(p - self.center)

    def delta(self, o: FloatArray, p: FloatArray, reach: FloatArray) -> FloatArray:
        """(n,): `float32.delta` in the counterpart's coordinates: how far float32 may move a
        surface, seen along a ray from o to p.  In a moved frame our own rounding is added, which
        far from the origin is not negligible beside it."""
        size = self.largest(o) + self.largest(p) + reach
        found = ROUNDINGS * UNIT_ROUNDOFF * size
        if not self.is_ours:
            center = float(np.abs(self.center).max())
            found += ROUNDINGS * UNIT_ROUNDOFF_64 * (size + 3.0 * center)
        return found

    def epsilon(self, p: FloatArray) -> FloatArray:
        """(n,): the height above a surface at p at which Mitsuba starts rays, in scene units."""
        return RAY_EPSILON * (1.0 / self.scale + self.largest(p))


OURS = Frame()


def frame_for(lower: FloatArray, upper: FloatArray) -> Frame:
    """The frame for a scene within these bounds (3,), the eye included: OURS, unless Mitsuba would
    start rays more than SHARE of the scene's half size off surfaces."""
    half = float((upper - lower).max()) / 2.0
    reach = float(np.abs([lower, upper]).max())
    if not (0.0 < half < math.inf) or RAY_EPSILON * (1.0 + reach) <= SHARE * half:
        return OURS
    step = 2.0 ** math.floor(math.log2(half))
    center = np.round((lower + upper) / 2.0 / step) * step
    return Frame(tuple(center.tolist()), 1.0 / step)
