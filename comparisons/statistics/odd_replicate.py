"""Leave-one-out test: whether one replicate has another mean than the rest.

In every small block the replicates are ranked. If all have one distribution, each is as likely to
have any rank, whatever that distribution is: a firefly moves the rank of one block only. The mean
rank of a replicate over many blocks is then nearly normal. It is tested over the whole picture,
over its halves, and along its gradient, which shows a shift; for each channel and for their mean.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import cell_means, cell_sums, ranks_of

BLOCK = 4
"""Side of a block in pixels: larger than a usual filter's radius, as in `ranks`."""

FEWEST_TO_LEAVE_ONE_OUT = 6
"""Fewer do not show how much replicates scatter."""

FEWEST_BLOCKS = 36
"""The mean rank of fewer blocks is not normal."""

LEVEL = 1e-4
"""Chance of a false alarm of all tests of one side together.  It is larger where all pixels of a
replicate share one brightness of few values: five of six may have one, and the sixth another."""

STANDARD_ERRORS = 6.0
"""Threshold if blocks are independent, whose standard error is known: one false alarm in 10^6 for
all tests of 16 replicates. The rest of LEVEL is for blocks that share a little noise."""

SHARED = 2.0
"""The largest ratio of the measured variance of mean ranks to the known one at which blocks count
as independent. If pixels share random numbers it is larger, and Student's t decides."""

AROUND = 4
"""Side, in blocks, of the squares within which blocks may share noise: 16 pixels."""

MATTERS = 0.1
"""Least mean rank, on a scale from -0.5 to 0.5, that is reported: a difference of about a third of
a block's standard deviation."""

CHANNELS = ("", "R", "G", "B")


@dataclass(frozen=True)
class OddReplicate:
    """index: of the replicate;  bias: the median over blocks of its relative difference from the
    other replicates' median;  where: the part of the picture, "" for all of it;  channel: "R", "G",
    "B", or "" for their mean;  errors: how many standard errors its ranks are from the others'."""

    index: int
    bias: float
    where: str
    channel: str
    errors: float


@dataclass(frozen=True)
class _Test:
    """ranks: the mean rank of each replicate, (R,);  error: its standard error if blocks are
    independent."""

    where: str
    channel: int
    ranks: FloatArray
    error: float


def odd_replicate(pictures: FloatArray) -> OddReplicate | None:
    """The one replicate of (R, height, width, 3) whose mean differs from the others'; None if there
    is none, if several differ, or if there are too few replicates or noisy blocks to tell."""
    count = len(pictures)
    if count < FEWEST_TO_LEAVE_ONE_OUT:
        return None
    blocks = cell_means(pictures, BLOCK)
    features = np.concatenate([blocks.mean(axis=-1, keepdims=True), blocks], axis=-1)
    middle = np.median(features, axis=0)
    noisy = features.std(axis=0) > 1e-6 * max(float(np.abs(middle).mean()), 1e-300)
    ordered = ranks_of(features) - 0.5 * (count + 1)
    every = np.where(noisy, ordered / (count - 1), 0.0)
    parts = _parts(middle[..., 0])
    tests = list(_tests(every, noisy, parts))
    if not tests:
        return None
    ranks = np.stack([test.ranks for test in tests])
    known = np.array([test.error for test in tests])
    rows, at = np.arange(len(tests)), np.abs(ranks).argmax(axis=1)
    # The ranks of a block have the sum zero: the others' mean follows.
    from_others = ranks + (ranks[rows, at] / (count - 1))[:, None]
    furthest = np.abs(from_others[rows, at])
    from_others[rows, at] = 0.0
    variance = (from_others**2).sum(axis=1) / (count - 2)
    shared = max(float((variance / known**2).mean()), _by_neighbours(every, noisy))
    if shared <= SHARED:
        errors, limit = furthest / (known * math.sqrt(max(shared, 1.0))), STANDARD_ERRORS
    else:
        errors = furthest / np.sqrt(np.maximum(variance * count / (count - 1), 1e-300))
        limit = -float(special.stdtrit(count - 2, LEVEL / (2 * ranks.size)))
    proven = (errors > limit) & (furthest > MATTERS)
    if not proven.any():
        return None
    k = int(np.where(proven, errors, -1.0).argmax())
    test, index = tests[k], int(at[k])
    bias = _median_bias(features[..., test.channel], index, parts[test.where])
    return OddReplicate(index, bias, test.where, CHANNELS[test.channel], float(errors[k]))


def _parts(picture: FloatArray) -> dict[str, FloatArray]:
    """Weights of blocks, (rows, columns), by the name of a part of the picture."""
    row, column = np.indices(picture.shape)
    height, width = picture.shape
    everywhere = np.ones(picture.shape)
    parts = {
        "": everywhere,
        "in the left half": np.where(2 * column < width, everywhere, 0.0),
        "in the right half": np.where(2 * column >= width, everywhere, 0.0),
        "in the upper half": np.where(2 * row < height, everywhere, 0.0),
        "in the lower half": np.where(2 * row >= height, everywhere, 0.0),
    }
    if min(picture.shape) > 1:
        for axis, name in ((1, "along x, as if shifted"), (0, "along y, as if shifted")):
            slope = np.gradient(picture, axis=axis)
            parts[name] = np.sign(np.where(np.abs(slope) > np.median(np.abs(slope)), slope, 0.0))
    return parts


def _tests(
    ranks: FloatArray, noisy: npt.NDArray[np.bool_], parts: dict[str, FloatArray]
) -> Iterator[_Test]:
    """For the ranks of every block, (R, rows, columns, 4), 0 where a block is not noisy."""
    for where, part in parts.items():
        for channel in range(len(CHANNELS)):
            weights = np.where(noisy[..., channel], part, 0.0)
            blocks = np.count_nonzero(weights)
            if blocks >= FEWEST_BLOCKS:
                means = np.tensordot(ranks[..., channel], weights, axes=2) / blocks
                error = math.sqrt(_variance(len(ranks)) / blocks)
                yield _Test(where, channel, np.asarray(means), error)


def _variance(count: int) -> float:
    """Of the rank of one among `count` replicates, from -0.5 to 0.5."""
    return (count + 1) / (12.0 * (count - 1))


def _by_neighbours(ranks: FloatArray, noisy: npt.NDArray[np.bool_]) -> float:
    """The variance of sums over squares of AROUND blocks, as a multiple of that of independent
    blocks: larger where neighbouring blocks share noise, as in a photon map."""
    blocks = cell_sums(noisy.astype(np.float64), AROUND)
    means = ranks.sum(axis=(1, 2), keepdims=True) / max(float(noisy.sum() / len(CHANNELS)), 1.0)
    sums = cell_sums(np.where(noisy, ranks - means, 0.0), AROUND)[:, blocks > 0.0]
    expected = float(blocks.sum()) * _variance(len(ranks))
    # The median, which an odd replicate does not move.
    return float(np.median((sums**2).sum(axis=1))) / max(expected, 1e-300)


def _median_bias(blocks: FloatArray, index: int, part: FloatArray) -> float:
    others = np.median(np.delete(blocks, index, axis=0), axis=0)
    lit = (np.abs(others) > 0.0) & (part != 0.0)
    return float(np.median(blocks[index][lit] / others[lit])) - 1.0 if lit.any() else 0.0
