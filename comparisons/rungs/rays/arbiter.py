"""The arbiter: traces rays next to one on which the two renderers disagree.

Mitsuba effectively traces a ray somewhere within its error bound of the requested one.  If our
float64 tracer finds Mitsuba's hit for such a neighbouring ray, float32 cannot resolve the requested
ray: it passes an edge or a silhouette.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy import special

from reference_rt.core.arrays import FloatArray, IntArray

BoolArray = npt.NDArray[np.bool_]

NEIGHBOURS = 48
"""Moved rays for each radius.  So many points leave no cap of the sphere empty that is higher than
a twelfth of the radius: some moved ray lies beyond every edge that cuts off more than that."""

MOST = 20_000
"""Most rays that are arbitrated; the rest count as differing."""

RADII = (1.0, 0.5)

SEARCHES = ((MOST, NEIGHBOURS, RADII), (500, 400, (1.0, 0.5, 0.2)))
"""(most rays, moves, radii) of each search: then a finer one for the few rays that are left, which
pass through a corner, or a face seen edge-on."""

LIMIT = 0.01
"""Largest fraction of rays that may need the arbiter.  Edges and silhouettes, a float32 bound wide,
take 1e-4 of a picture or less; beyond 1 % the comparison measures Mitsuba's precision."""

SURE = 1e-4
"""Chance of reporting, falsely, that a fraction of rays exceeds its limit."""

REST = 0.1
"""Least share of what is lit that must be resolved and agree.  With less, agreement would rest on
values that say nothing, and a fault could hide in the others."""

AT_ONCE = 8000
"""Moved rays that are traced in one call, when fewer rays than these are left."""


def too_many(count: int, total: int, limit: float = LIMIT) -> bool:
    """Whether `count` of `total` rays prove a fraction above `limit` (binomial test): of few rays
    one may be too many by chance."""
    return bool(special.bdtrc(count - 1, total, limit) < SURE)


def most_of(count: int, total: int) -> float:
    """The upper end of the confidence interval of a fraction of which `count` of `total` were
    found (Clopper and Pearson 1934)."""
    return float(special.betaincinv(count + 1, total - count, 1.0 - SURE)) if count < total else 1.0


def tells(bound: FloatArray, *sides: FloatArray) -> BoolArray:
    """(n,): whether an error bound (n,) leaves values (n, 3) of two sides anything to say: it is at
    most half of them."""
    return np.asarray(bound <= 0.5 * np.maximum(*(np.abs(side).max(axis=1) for side in sides)))


def is_enough(right: int, total: int) -> bool:
    """Whether values that agree are a share of all on which a rung may rest;  total: without those
    that are dark."""
    return right >= REST * total


def directions(n: int) -> FloatArray:
    """n unit vectors (n, 3) spread evenly over the sphere (the golden spiral)."""
    k = np.arange(n) + 0.5
    z = 1.0 - 2.0 * k / n
    phi = np.pi * (1.0 + np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def explained(
    rays: IntArray, radius: FloatArray, like_theirs: Callable[[IntArray, FloatArray], BoolArray]
) -> BoolArray:
    """Which of the rays with the indices `rays` (m,) a move by up to `radius` (m,) explains.

    `like_theirs(rays, offsets)` traces the rays (k,) moved by offsets (k, 3) and returns which now
    agree with Mitsuba.  False for all beyond the first MOST.
    """
    settled = np.zeros(len(rays), bool)
    for most, count, radii in SEARCHES:
        moves = np.concatenate([factor * directions(count) for factor in radii])
        done = 0
        while done < len(moves):
            open_ = np.flatnonzero(~settled[:MOST])
            if len(open_) == 0 or len(open_) > most:
                break
            some = moves[done : done + max(1, AT_ONCE // len(open_))]
            offsets = some * radius[open_][:, None, None]
            agree = like_theirs(np.repeat(rays[open_], len(some)), offsets.reshape(-1, 3))
            settled[open_] = agree.reshape(len(open_), -1).any(axis=1)
            done += len(some)
    return settled
