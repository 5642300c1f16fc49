"""The coordinates in which Mitsuba sees a scene: moved and scaled where float32 needs that.

Mitsuba begins the rays that leave a surface (1 + max |p|) RAY_EPSILON off it.  A scene that lies
far from the origin, or is small, loses everything thinner than that.  Its twin is then moved to
the origin and scaled to unit size; rays go there, and what they hit comes back.
"""

import math
from typing import NamedTuple

import numpy as np

from comparisons.geometry.float32 import ROUNDINGS, UNIT_ROUNDOFF, largest, round32
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF as UNIT_ROUNDOFF_64

RAY_EPSILON = 1500.0 * 2.0**-24
"""Mitsuba's `math::RayEpsilon`: rays that leave a surface begin (1 + max |p|) times this off it."""

SHADOW_EPSILON = 10.0 * RAY_EPSILON
"""Mitsuba's `math::ShadowEpsilon`: shadow rays end this fraction of their length early."""

SHARE = 0.01
"""Of a scene's half size, that rays may begin off surfaces before its twin is moved: what is as
large as that is then not seen from the surface beside it.  The same hundredth as
`arbiter.LIMIT`: with less the reference's precision is what is compared."""


class Frame(NamedTuple):
    """Twin's coordinates (p - center) scale: center has few digits, scale is a power of two, so
    that the map is exact, or rounds by less than float64's numbers at p are apart."""

    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0

    @property
    def is_ours(self) -> bool:
        """Whether the twin stands where our scene does."""
        return self == OURS

    def into(self, p: FloatArray) -> FloatArray:
        """Points (n, 3) of ours in the twin's coordinates."""
        return p if self.is_ours else np.asarray((p - self.center) * self.scale)

    def out(self, p: FloatArray) -> FloatArray:
        """Points (n, 3) of the twin in our coordinates."""
        return p if self.is_ours else np.asarray(p / self.scale + self.center)

    def rounded(self, p: FloatArray) -> FloatArray:
        """The nearest points (n, 3) that the twin can hold in float32, and we in float64."""
        return self.out(round32(self.into(p)))

    def largest(self, p: FloatArray) -> FloatArray:
        """(n,): the largest coordinate of points (n, 3) from where the twin's origin is, in our
        units."""
        return largest(p) if self.is_ours else largest(p - self.center)

    def delta(self, o: FloatArray, p: FloatArray, reach: FloatArray) -> FloatArray:
        """(n,): how far float32 may move a surface, seen along a ray from o to p: as
        `float32.delta` says, in the twin's coordinates.  Where these are not ours, our own rounding
        in ours, which there is not the 2^29th part of it, is added."""
        size = self.largest(o) + self.largest(p) + reach
        found = ROUNDINGS * UNIT_ROUNDOFF * size
        if not self.is_ours:
            center = float(np.abs(self.center).max())
            found += ROUNDINGS * UNIT_ROUNDOFF_64 * (size + 3.0 * center)
        return found

    def epsilon(self, p: FloatArray) -> FloatArray:
        """(n,): how far off a surface at p Mitsuba begins rays, in our units."""
        return RAY_EPSILON * (1.0 / self.scale + self.largest(p))


OURS = Frame()


def frame_for(lower: FloatArray, upper: FloatArray) -> Frame:
    """The frame for a scene within these bounds (3,), the eye included: ours, unless rays would
    begin more than SHARE of its half size off surfaces there."""
    half = float((upper - lower).max()) / 2.0
    reach = float(np.abs([lower, upper]).max())
    if not (0.0 < half < math.inf) or RAY_EPSILON * (1.0 + reach) <= SHARE * half:
        return OURS
    step = 2.0 ** math.floor(math.log2(half))
    center = np.round((lower + upper) / 2.0 / step) * step
    return Frame(tuple(center.tolist()), 1.0 / step)
