"""Tests whether replicates that should be independent share noise."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy import ndimage, special
from scipy.linalg import helmert

from comparisons.results.case import FloatArray
from comparisons.statistics.scales import HALF, cell_means, cell_sums, ranks_of, tile_sums

# ---- replicates without noise, or the same as others bit for bit: an error, or chance ------------
#
# A few noisy pixels, at the edges of a flat picture or where a small lamp is met, may well be the
# same again.  Of independent pixels that differ with the probabilities q, none does with a
# probability of at most exp(-sum q); the sum is estimated by the number of pixels that differ.


CHANCE = 1e-6
"""Probability below which it is no chance."""


def same_pairs(x: FloatArray) -> list[tuple[int, int]]:
    """The pairs of replicates (n, h, w, 3) that are identical."""
    return [(i, j) for i, j in combinations(range(len(x)), 2) if np.array_equal(x[i], x[j])]


def may_be_the_same(x: FloatArray, other: FloatArray) -> bool:
    """Whether identical pairs of the replicates x may be chance;  other: the other side's
    replicates, whose noise counts where all of x are the same."""
    repeated = {j for _, j in same_pairs(x)}
    return _is_chance(len(repeated), _differing(x), _differing(other) if len(other) > 1 else [])


def may_be_flat(x: FloatArray, other: FloatArray, deviating: Callable[[FloatArray], int]) -> bool:
    """Whether pictures of x without a deviating pixel may be chance;  deviating: the number of
    pixels of one picture (h, w, 3)."""
    counts = [deviating(picture) for picture in x]
    others = [deviating(picture) for picture in other] if len(other) > 1 else []
    return _is_chance(counts.count(0), counts, others)


def _is_chance(times: int, counts: list[int], others: list[int]) -> bool:
    """Whether a number of pixels may be 0 so many times among `counts`.

    Its mean is that of `counts`, or if they are all 0 that of `others`; if that is not known
    either, nothing is chance.  By the union bound over which ones are 0.
    """
    known = counts if any(counts) else others
    if not any(known):
        return False
    ways = math.log(math.comb(len(counts), times))
    return ways - times * float(np.mean(known)) > math.log(CHANCE)


def _differing(x: FloatArray) -> list[int]:
    """The number of pixels that differ, for each pair."""
    pairs = combinations(range(len(x)), 2)
    return [int(np.count_nonzero((x[i] != x[j]).any(axis=-1))) for i, j in pairs]


# ---- leave-one-out test: whether one replicate has another mean than the rest --------------------
#
# In every small block the replicates are ranked. If all have one distribution, each is as likely to
# have any rank, whatever that distribution is: a firefly moves the rank of one block only. The mean
# rank of a replicate over many blocks is then nearly normal. It is tested over the whole picture,
# over its halves, and along its gradient, which shows a shift; for each channel and for their mean.


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


FEWEST_PIXELS = 256
"""Least number of noisy pixels for these tests."""

CORRELATED = 0.1
"""Correlation of the noise of two replicates above which it matters."""

FEWEST_REPLICATES = 6
"""Least number of replicates whose pairs are compared: four or five have too few pairs to show how
far correlations scatter if all pixels share a few random numbers."""

OUTLYING = (4.0, 48.0)
"""(a, b): a correlation must lie a + b / R times the scatter of ordinary pairs above these before
two of R replicates share noise, 12 times for R = 6 and 7 times for R = 16. For noise that all
pixels have in common, of 1 to 1,000 components, normal or Laplace distributed, the largest of
independent replicates was 8 and 5 times away once in 1,000 runs; of one uniform random number, once
in 300 runs 8 times for R = 8."""

OUTLYING_ALONE = (5.0, 250.0)
"""(a, b): the same for one pair against the other R - 2 replicates alone: a + b / (R - 3)^2 times
their scatter. Of noise with 1 to 1,000 components, normal, Laplace or uniform, the largest of
independent pairs was 27.6, 9.4, 6.6 and 5.1 times away once in 1,000 runs for R = 6, 8, 12, 16."""

ORDINARY = 0.65
"""The fraction of pairs below which a pair is an ordinary one. If a single random number makes all
noise, pairs have correlations of +1 or -1, and at least 0.4 of them have +1. If each replicate
shares noise with the next one, 0.33 of the pairs of six do."""

WHITE = 0.15
"""Largest correlation of neighbouring pixels for noise that is independent between pixels; errors
of a picture lie along edges or over surfaces, and are correlated."""

LIKE_PICTURE = 0.1
"""Largest fraction of common noise that the reference's channels, their gradient and curvature may
explain: a gain, exchanged or mixed channels, a shift or a filter cause such a difference in a
picture with fine texture."""

BY_CHANCE = 5e-4
"""Chance that independent replicates have as much noise in common; the other conditions make an
alarm rarer still."""

SHARING = 2.0
"""How many times as much as that of independent tiles the squares of a difference of replicates
scatter if pixels far from each other share random numbers."""

FEWEST_TILES = 4
"""Least number of tiles whose scatter is compared with that of whole pictures."""

EVERYWHERE = 0.5
"""Least common noise of the median tile, as a fraction of the mean: shared noise is everywhere."""


def correlated_pair(pictures: FloatArray) -> tuple[int, int, float] | None:
    """The two replicates of (R, height, width, 3) that share noise, and its correlation; None if no
    two do, or if that cannot be told.

    Pixels may depend on each other, as in a photon map or after a denoiser. The correlations of
    independent replicates then scatter by 1 / sqrt(the number of independent pixels), which is the
    same for all pairs. So two share noise if their correlation is an outlier among all pairs, and
    much further from ordinary ones than any negative correlation. It must be so for the noise and
    for its detail: a rare event that brightens two pictures is smooth, equal seeds repeat detail.
    """
    count = len(pictures)
    deviation = pictures - pictures.mean(axis=0)
    scale = np.sqrt((deviation**2).mean(axis=0))
    noisy = scale > 1e-9 * max(float(np.abs(pictures).max()), 1e-300)
    pixels = int(np.count_nonzero(noisy.any(axis=-1)))
    if count < FEWEST_REPLICATES or pixels < FEWEST_PIXELS:
        return None
    z = np.where(noisy, deviation / np.where(noisy, scale, 1.0), 0.0)
    products = [_products(band) for band in (z, _detail(z))]
    bands = [_correlations(band) for band in products]
    lowest = np.min([band - _highest_by_chance(band, pixels) for band in bands], axis=0)
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(lowest), lowest.shape))
    if lowest[i, j] > 0.0:
        return i, j, float(bands[0][i, j])
    # Two that share noise pull the common mean towards them: their correlations with all others
    # become negative, and hide that they are outliers. So they are judged by the others alone.
    least = np.min(bands, axis=0)
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(least), least.shape))
    alone = [_beyond_others(band, i, j, pixels) for band in products]
    return (i, j, float(bands[0][i, j])) if min(alone) > 0.0 else None


def _detail(z: FloatArray) -> FloatArray:
    """Deviations from the mean of the neighbours."""
    around = np.array([[0.0, 0.25, 0.0], [0.25, 0.0, 0.25], [0.0, 0.25, 0.0]])
    return np.asarray(z - ndimage.convolve(z, around[None, :, :, None], mode="reflect"))


def _products(deviations: FloatArray) -> FloatArray:
    """(R, R): of the deviations of replicates, summed over a picture."""
    z = deviations.reshape(len(deviations), -1)
    return np.asarray(z @ z.T)


def _correlations(products: FloatArray) -> FloatArray:
    """(R, R): between replicates, -inf on the diagonal;  products: of deviations from their mean.

    Deviations of independent replicates from the common mean have a correlation of -1 / (R - 1),
    which is removed.
    """
    count = len(products)
    length = np.sqrt(np.maximum(np.diag(products), 1e-300))
    found = products / np.outer(length, length) * (count - 1) / count + 1.0 / count
    np.fill_diagonal(found, -np.inf)
    return np.asarray(found)


def _beyond_others(products: FloatArray, i: int, j: int, pixels: int) -> float:
    """By how much the correlation of replicates i and j, about the mean of the others, exceeds what
    the correlations of the others permit."""
    count = len(products)
    others = np.delete(np.arange(count), (i, j))
    about = np.eye(count)  # takes that mean from each replicate
    about[:, others] -= 1.0 / (count - 2)
    of_all = about @ products @ about.T
    # Both contain the noise of that mean, which is a correlation of 1 / (R - 1).
    length = math.sqrt(max(float(of_all[i, i] * of_all[j, j]), 1e-300))
    found = (float(of_all[i, j]) / length - 1.0 / (count - 1)) * (count - 1) / (count - 2)
    pairs = _correlations(of_all[np.ix_(others, others)])[np.triu_indices(count - 2, 1)]
    scatter = max(math.sqrt(float((pairs**2).mean())), 1.0 / math.sqrt(pixels))
    times = OUTLYING_ALONE[0] + OUTLYING_ALONE[1] / (count - 3) ** 2
    return found - max(CORRELATED, times * scatter, -2.0 * float(pairs.min()))


def _highest_by_chance(correlations: FloatArray, pixels: int) -> float:
    """The correlation that two independent replicates hardly ever exceed."""
    count = len(correlations)
    pairs = correlations[np.triu_indices(count, 1)]
    ordinary = float(np.quantile(pairs, ORDINARY, method="lower"))
    below = np.maximum(ordinary - pairs, 0.0)
    scatter = math.sqrt(float((below**2).sum()) / (ORDINARY * len(pairs)))
    scatter = max(scatter, 1.0 / math.sqrt(pixels))
    times = OUTLYING[0] + OUTLYING[1] / count
    return max(CORRELATED, ordinary + max(times * scatter, 2.0 * float(below.max())))


def common_noise(candidate: FloatArray, reference: FloatArray) -> float | None:
    """The variance of the error common to all replicates of the candidate, over the variance of one
    replicate; None if that error does not look like noise.

    Both (replicates, height, width, 3).  Unlike the error of a wrong picture, noise is independent
    between pixels, present everywhere, and unlike the picture and its gradient.  So is the rounding
    of texels that one side stores as half floats: what that may make is subtracted.  The error must
    exceed what the scatter of the replicates' own differences makes, which is large where all
    pixels use the same random numbers.
    """
    sides = (candidate, reference)
    variances = [x.var(axis=0, ddof=1) for x in sides]
    own = variances[0].sum(axis=-1)
    difference = candidate.mean(axis=0) - reference.mean(axis=0)
    noise = sum(v.sum(axis=-1) / len(x) for v, x in zip(variances, sides, strict=True))
    noise = noise + ((HALF * reference.mean(axis=0)) ** 2).sum(axis=-1)
    noisy = own > 1e-12 * float((reference**2).mean())
    if np.count_nonzero(noisy) < FEWEST_PIXELS:
        return None
    total = tile_sums(np.where(noisy, (difference**2).sum(axis=-1) - noise, 0.0))
    of_own = tile_sums(np.where(noisy, own, 0.0))
    some = of_own > 0.0
    ratios = total[some] / of_own[some]
    share = float(total.sum() / of_own.sum())
    scatter = float(ratios.std()) / math.sqrt(max(len(ratios) - 1, 1))
    if not float(ratios.mean()) > 5.0 * scatter:  # one false alarm in a million, were it normal
        return None
    squares = float((difference[noisy] ** 2).sum())
    by_chance = sum(_factor_by_chance(x, noisy) for x in sides)
    if not math.log(max(squares, 1e-300) / float(noise[noisy].sum())) > by_chance:
        return None
    if not (share > 0.0 and float(np.median(ratios)) > EVERYWHERE * float(ratios.mean()) > 0.0):
        return None
    # Each channel by itself: errors of channels that are exchanged cancel in their sum.
    z = np.where(noisy[..., None], difference / np.sqrt(np.where(noisy, own, 1.0))[..., None], 0.0)
    if max(abs(_neighbours(np.moveaxis(side, -1, 0))) for side in (z, z.swapaxes(0, 1))) > WHITE:
        return None
    if _explained(z, reference.mean(axis=0), variances[1] / len(reference), own, noisy) > (
        LIKE_PICTURE
    ):
        return None
    return share


def _factor_by_chance(pictures: FloatArray, noisy: npt.NDArray[np.bool_]) -> float:
    """The logarithm of the factor by which the squares of the mean's noise hardly ever exceed their
    expectation: from R - 1 orthogonal differences of R replicates, each with the noise of one."""
    if len(pictures) < 3:
        return 0.0
    squares = (_differences(pictures)[:, noisy] ** 2).sum(axis=(1, 2))
    return _log_factor(squares)


def excess_by_sharing(pictures: FloatArray) -> float:
    """The factor by which the squares of the mean's noise hardly ever exceed their expectation if
    pixels far from each other share random numbers; 1 if they do not.

    pictures: replicates (R, height, width, 3).  It is 1 too for fewer than four replicates, which
    do not show it.
    """
    noise = tile_sums(pictures.var(axis=0, ddof=1).sum(axis=-1)) if len(pictures) > 3 else None
    if noise is None or not (noise > 0.0).any():
        return 1.0
    lit = noise > 0.0
    squares = (_differences(pictures) ** 2).sum(axis=-1)
    ratios = np.stack([tile_sums(x)[lit] / noise[lit] for x in squares])
    means = ratios.mean(axis=1)
    if ratios.shape[1] < FEWEST_TILES:
        return math.exp(_log_factor(means))
    of_tiles = math.sqrt(float((ratios.var(axis=1, ddof=1) / ratios.shape[1]).mean()))
    if float(means.std(ddof=1)) < SHARING * of_tiles:
        return 1.0
    return math.exp(_log_factor(means))


def _differences(pictures: FloatArray) -> FloatArray:
    """(R - 1, height, width, 3): orthogonal, each with the noise of one replicate and no mean."""
    return np.asarray(np.tensordot(helmert(len(pictures)), pictures, axes=1))


def _log_factor(squares: FloatArray) -> float:
    scatter = float(np.log(np.maximum(squares, 1e-300)).std(ddof=1))
    return -float(special.stdtrit(len(squares) - 1, BY_CHANCE)) * scatter


def _neighbours(z: FloatArray) -> float:
    """The correlation of horizontal neighbours in pictures (..., height, width)."""
    left, right = z[..., :-1], z[..., 1:]
    power = math.sqrt(float((left**2).sum()) * float((right**2).sum()))
    return float((left * right).sum()) / power if power else 0.0


def _explained(
    z: FloatArray, picture: FloatArray, noise: FloatArray, own: FloatArray, noisy: FloatArray
) -> float:
    """The fraction of z (height, width, 3) that the picture's channels, and the gradient and
    curvature of their sum, explain, fitted jointly;  noise: the picture's variance."""
    if min(picture.shape[:2]) < 3:
        return 1.0
    grey = picture.sum(axis=-1)
    dy, dx = (np.asarray(slope) for slope in np.gradient(grey))
    curvature = np.asarray(np.gradient(dy, axis=0)) + np.asarray(np.gradient(dx, axis=1))
    weights = 1.0 / np.sqrt(own[noisy])
    channels = picture[noisy] * weights[:, None]
    # Mixtures of channels that are mostly noise, as where all have one hue, would explain noise.
    noise_of = (noise[noisy] * weights[:, None] ** 2).sum(axis=0) + 1e-300
    power, mixtures = np.linalg.eigh(channels.T @ channels / np.sqrt(np.outer(noise_of, noise_of)))
    seen = mixtures[:, power > SEEN] / np.sqrt(noise_of)[:, None]
    basis = np.column_stack([channels @ seen, *(x[noisy] * weights for x in (dx, dy, curvature))])
    wanted = z[noisy]
    fitted = basis @ np.linalg.lstsq(basis, wanted, rcond=None)[0]
    return float((fitted**2).sum() / (wanted**2).sum())


SEEN = 10.0
"""Least power of a mixture of channels over that of its noise: noise is then at most a tenth of
what the mixture explains, which is LIKE_PICTURE."""
