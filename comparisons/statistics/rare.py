"""Light that few of the replicates met: how much of it a side may have missed by chance.

Where light is found only by scattered rays, as a small lamp is without light sampling, it reaches a
pixel in few events, each of them large. A pixel or a tile that no event has reached is too dark,
and the spread of its replicates does not show it: spread is measured on what was met. So the size
of an event is taken from the whole picture, from the *energy met once*: that by which one replicate
of a pixel exceeds all others of it, where these are alike.

If energy D is missing from a sum, and came in independent events of energy e, D / e events were
expected. That none was met has the chance exp(-D / e) (Poisson), which a normal number has beyond
sqrt(2 D / e) standard deviations. So the missing light counts as noise of variance D e / 2, which
is added to the variance of what was met. (Of some events that were met the spread is known, with as
many degrees of freedom.) For events of unequal energies e is their mean weighted by energy, since
the variance of a sum of events is the sum of their squares.

Light that no pixel of any replicate met is not covered: `Unseen` says what can be said about it.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from comparisons.results.case import FloatArray
from comparisons.statistics.metrics import ratio
from comparisons.statistics.scales import DARK

ALONE = 0.5
"""A pixel's largest value is energy met once if it exceeds the second largest by this fraction of
the range of all replicates. Of 16 normal numbers 0.2 % do so, and of 16 exponential ones 11 %."""


def met_once(pictures: FloatArray) -> FloatArray:
    """(R, h, w, 3) -> (h, w, 3): the energy, in one replicate, that only this one has met."""
    most = np.maximum(pictures[0], pictures[1])
    second = np.minimum(pictures[0], pictures[1])
    least = second.copy()
    for picture in pictures[2:]:  # one at a time: fits the cache
        np.maximum(second, np.minimum(most, picture), out=second)
        np.maximum(most, picture, out=most)
        np.minimum(least, picture, out=least)
    excess = most - second
    return np.asarray(np.where(excess > ALONE * (most - least), excess, 0.0))


def event(energy: FloatArray, scale: FloatArray, weight: FloatArray | float = 1.0) -> FloatArray:
    """(3,): of energies met once (h, w, 3) the size over `scale`, weighted by itself and by
    `weight`; 0 if there is none.

    If every event has the same multiple of its pixel's `scale`, this is that multiple; if all have
    one energy, it is that over the mean scale where they fell.
    """
    return event_of(weight * energy**2, weight * energy * scale)


def event_of(squares: FloatArray, products: FloatArray) -> FloatArray:
    """(3,): the sum of the squared energies (h, w, 3) over that of energies times scale."""
    return ratio(squares.sum(axis=(0, 1)), products.sum(axis=(0, 1)))


@dataclass(frozen=True)
class Unseen:
    """What replicates can tell of light that they did not meet.

    met_once: the share of a picture's energy that the other replicates did not meet in the same
    pixel (Good 1953, leaving one out);  missing: a bound on the share of the energy that is missing
    by chance, if all light comes in events like those that were met once;  values: how many values
    of pixels there are. Light that fewer of them meet is not covered by any bound.
    """

    met_once: float
    missing: float
    values: int


def unseen(pictures: FloatArray, level: float) -> Unseen:
    """Of replicates (R, h, w, 3); the bound fails with a chance of `level`.

    Energy met once, n times that of an event, bounds the expected number of such events by
    Garwood (1936); what exceeds n may be missing.
    """
    once = met_once(pictures)
    total = np.abs(pictures.mean(axis=0)).sum(axis=(0, 1)) * len(pictures)
    energy = once.sum(axis=(0, 1))
    size = ratio((once**2).sum(axis=(0, 1)), energy)
    count = ratio(energy, size)
    most = 0.5 * stats.chi2.isf(level / 3.0, 2.0 * (count + 1.0))  # three channels
    # A channel counts by its energy: in a dark one a share says little.
    scale = np.maximum(total, DARK * total.mean())
    return Unseen(
        met_once=float(ratio(energy, scale).max()),
        missing=float(ratio((most - count) * size, scale).max()),
        values=pictures[..., 0].size,
    )


def worse(one: Unseen | None, two: Unseen | None) -> Unseen | None:
    """The worse of both sides in each respect; None stands for a side without replicates."""
    if one is None or two is None:
        return one or two
    return Unseen(
        max(one.met_once, two.met_once),
        max(one.missing, two.missing),
        min(one.values, two.values),
    )
