"""Exact answers and error bounds: what F1 judges hits by."""

import numpy as np

from comparisons.experiments.stability.harness.outcomes import (
    Columns,
    FloatArray,
    Outcome,
    U,
    outcome,
    plain,
)
from comparisons.experiments.stability.harness.rays import Rays
from comparisons.geometry.exact.dyadic import (
    FRACTION,
    NEVER,
    BoolArray,
    Dyadic,
    Fixed,
    dot,
    nearest,
)
from comparisons.referee import KINDS, first_of

BAND = 5.0
"""u r: a line that passes the rim of a sphere by less is undecidable.

The closest approach p rounds twice in each coordinate, |p|² and r² as numbers of their own size:
r² - |p|² + (p·d)²/a is off by 2·2 u r² + 3 u r² + u r² + 2 u r², and r - |p| by half of that over
r.  Nothing here grows with the distance, nor with the offset.
"""

ROUNDINGS = 16.0
"""u (|t| |d| + D) that t |d| may be off by besides: the issue's number.  c / q rounds by some 10 u
of itself."""


def apart(t: FloatArray, exact: Fixed) -> FloatArray:
    """|t - exact|; the difference is taken before it is rounded.  All finite."""
    return nearest(np.abs(Dyadic.of(t).to(min(Dyadic.of(t).e, -FRACTION)).n - exact))


def gaps(rays: Rays) -> FloatArray:
    """(r - |closest approach|) / r of spheres' rays: above 0 for a hit.  Exact to a rounding."""
    f = Dyadic.of(rays.o) - Dyadic.of(rays.row["center"])
    d, r = Dyadic.of(rays.d), Dyadic.of(rays.row["radius"])
    a, b = dot(d, d), dot(f, d)
    scale = r * r * a
    relative = ((r * r - dot(f, f)) * a + b * b).floats() / scale.floats()
    return np.asarray(relative / (1.0 + np.sqrt(np.maximum(1.0 - relative, 0.0))))


class Truth:
    """The truth about rays at spheres, computed once for all contestants.

    u: the contestant's unit roundoff.  Within BAND u of the rim either answer is right, unless
    `strict`; t |d| may be off by ROUNDINGS u (|t| |d| + D) and by what the band makes of half the
    chord h: BAND u r² / h.
    """

    def __init__(self, rays: Rays, u: float = U, strict: bool = False) -> None:
        self.rays, band = rays, BAND * u
        crossings = KINDS["spheres"](rays.row, Dyadic.of(rays.o), Dyadic.of(rays.d))
        self.hit = first_of(crossings)
        self.gap = gaps(rays)
        self.open = (np.abs(self.gap) <= (0.0 if strict else band)) | self.hit.touching
        t = np.where(np.isfinite(self.hit.t), self.hit.t, 0.0)
        chord = rays.size * np.sqrt(np.maximum(self.gap * (2.0 - self.gap), band))
        self.bound = ROUNDINGS * u * (t * rays.speed() + rays.distance())
        self.bound += band * rays.size**2 / chord

    def judge(self, t: FloatArray) -> Outcome:
        return _outcome(self.rays, self.hit.t, self.hit.fixed, t, self.open, self.bound, self.gap)


def _outcome(
    rays: Rays,
    exact: FloatArray,
    fixed: Fixed,
    t: FloatArray,
    is_open: BoolArray,
    bound: FloatArray,
    gap: FloatArray | None = None,
) -> Outcome:
    t = np.where(np.isnan(t) | (t < 0.0), -1.0, t)  # neither a hit nor a miss
    both = np.isfinite(exact) & np.isfinite(t) & ~is_open
    share = np.zeros(len(t))
    share[both] = apart(t[both], fixed[both]) * rays.speed()[both] / bound[both]
    wrong = (np.isfinite(exact) != np.isfinite(t)) | (share > 1.0)
    worst = float(share[both].max()) if both.any() else None
    columns: Columns = {"kind": rays.kind, **rays.columns(), "expected": exact, "t": t}
    if gap is not None:
        columns["gap"] = plain(gap)
    return outcome(wrong, columns, is_open, worst)


DIRECTIONS = 8
"""Across a ray in which it is moved: one is within 22.5 degrees of a surface's normal."""

MOVED = 64.0
"""u times the size of a shape that is not a sphere: a ray's answer is right if it is that of a ray
which passes no further beside it.

Where the ray is next to the shape, in its own coordinates, 3 products round there and back (8 u for
a map that stretches by 4), the ten terms of f 9 times each, on numbers up to 4 times the size.
"""


def judge_by_moving(rays: Rays, t: FloatArray, u: float = U) -> Outcome:
    """Backward: right is what is exact for a ray that passes at most MOVED u sizes beside this
    one, but for ROUNDINGS u (|t| |d| + D) in t |d|.

    Open are the hits and misses that are so, but not without moving.
    """
    hit = first_of(KINDS[rays.kind](rays.row, Dyadic.of(rays.o), Dyadic.of(rays.d)))
    speed = rays.speed()
    bound = ROUNDINGS * u * (np.where(np.isfinite(hit.t), hit.t, 0.0) * speed + rays.distance())
    t = np.where(np.isnan(t) | (t < 0.0), -1.0, t)
    both = np.isfinite(hit.t) & np.isfinite(t)
    off = np.zeros(len(t))
    off[both] = apart(t[both], hit.fixed[both]) * speed[both]
    doubtful = np.flatnonzero((np.isfinite(hit.t) != np.isfinite(t)) | (off > bound))
    is_open = hit.touching.copy()
    low, high, some_miss = _moved(rays.only(doubtful), MOVED * u)
    for k, i in enumerate(doubtful.tolist()):
        if both[i]:
            spread = max(high[k] - hit.fixed[i], hit.fixed[i] - low[k]) if high[k] > 0 else 0
            bound[i] += float(nearest(np.array([spread], dtype=object))[0]) * speed[i]
        elif np.isfinite(t[i]):
            near = high[k] > 0 and _within(t[i], low[k], high[k], bound[i] / speed[i])
            is_open[i] |= bool(near)
        else:
            is_open[i] |= bool(some_miss[k])
    return _outcome(rays, hit.t, hit.fixed, t, is_open, bound)


def _within(t: float, low: int, high: int, slack: float) -> bool:
    found, margin = (int(n) >> FRACTION for n in Dyadic.of([t, slack]).to(-2 * FRACTION).n)
    return low - margin <= found <= high + margin


def _moved(rays: Rays, by: float) -> tuple[list[int], list[int], BoolArray]:
    """(the least and the largest t, 0 without hits, whether some miss) over all ways to move."""
    n = len(rays.o)
    low, high, some_miss = [int(NEVER)] * n, [0] * n, np.zeros(n, bool)
    if n == 0:
        return low, high, some_miss
    unit = rays.d / rays.speed()[:, None]
    axis = np.eye(3)[np.argmin(np.abs(unit), axis=1)]
    first = np.cross(unit, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(unit, first)
    o, d = Dyadic.of(rays.o), Dyadic.of(rays.d)
    for angle in 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        step = (first * np.cos(angle) + second * np.sin(angle)) * (by * rays.size)[:, None]
        found = first_of(KINDS[rays.kind](rays.row, o + Dyadic.of(step), d))
        for k, (fixed, t) in enumerate(zip(found.fixed.tolist(), found.t, strict=True)):
            if np.isfinite(t):
                low[k], high[k] = min(low[k], fixed), max(high[k], fixed)
            else:
                some_miss[k] = True
    return low, high, some_miss
