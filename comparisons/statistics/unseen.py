"""What can be said of light that no pixel of any replicate met."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import divisor
from comparisons.statistics.metrics import ratio
from comparisons.statistics.sides import met_once


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
    most = 0.5 * special.chdtri(2.0 * (count + 1.0), level / 3.0)  # three channels
    # A channel counts by its energy: in a dark one a share says little.
    scale = divisor(total, total.mean())
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
