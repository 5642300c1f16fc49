"""How well a predicted picture fits the candidate: the score of a hypothesis."""

import copy
import math
from collections.abc import Iterator

import numpy as np
import scipy
from scipy import ndimage

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.results.case import FloatArray, Images
from comparisons.statistics.cells import divisor

FLOOR = 0.005
"""Relative to a pixel's brightness, or the picture's if that is brighter: smaller differences have
little weight, so that dark and noise-free pixels do not dominate."""

BLOCKS = (1, 8, 32)
"""Block sides in pixels: sums over blocks reveal errors of brightness in more noise than pixels."""

FEWEST_BLOCKS = 3
"""Blocks along either side: with fewer, hypotheses cannot be distinguished."""

KURTOSIS = 3.0
"""The variance of squares of real noise, relative to that of Gaussian noise."""

CLEARLY = 6.0
"""Standard deviations by which a difference must exceed noise before a cause is sought."""

NO_MORE = 3.0
"""Standard deviations that the noise of what a right cause leaves hardly ever exceeds: the scatter
is that of noise with KURTOSIS."""

REST = 0.1
"""The largest part of a bias, or of the squared difference of blocks, that a named cause leaves: a
light of 64 samples per pixel, or a filter that is nearly the one used, leaves some percent."""

BIAS = 0.001
"""A bias of a channel's mean that is permitted (`statistics.Margins`) needs no cause."""

DISTINCT = 50.0
"""Two fits are distinguished if their squares differ by this many times the noise of one value:
about four standard deviations of the difference, for noise with KURTOSIS."""


NO_MATTER = 1e-4
"""Unexplained fractions below this are rounding, and do not distinguish hypotheses."""

ROUNDING = 2.0**-11
"""Of half floats, relative to a value."""

FEW_VALUES = 256
"""Of 8 bits: a candidate with no more is rounded to them."""

STEEPEST = 2.4 / 1.055
"""The derivative of linear values by sRGB-encoded ones, at 1."""


class Misfit:
    """The weighted squared difference between the candidate and a predicted picture, over pixels or
    blocks: the scale at which the difference exceeds the noise most clearly.

    The weights are 1 / (variance of the noise + FLOOR's).
    """

    def __init__(self, images: Images) -> None:
        self.candidate, self.reference = images.candidate, images.reference
        error2 = np.zeros_like(self.reference) if images.error is None else images.error**2
        own = images.reference_error
        self._reference_error2 = 0.5 * error2 if own is None else own**2
        # Few replicates estimate the variance badly; neighbouring pixels have similar ones.
        error2 = np.maximum(error2, ndimage.uniform_filter(error2, (3, 3, 1)))
        size = np.maximum(np.abs(self.candidate), np.abs(self.reference))
        size = ndimage.maximum_filter(size, (3, 3, 1))
        # Most of a picture may be black, and a warp may show something there.
        least = max(float(np.median(size)), FLOOR * float(size.mean()))
        floor2 = FLOOR**2 * np.maximum(size, least) ** 2 + 1e-300
        side = min(error2.shape[:2])
        scales = [
            _Scale(block, error2, floor2)
            for block in BLOCKS
            if block == 1 or side >= FEWEST_BLOCKS * block
        ]
        self._inside: FloatArray | float = 1.0
        self._rounding = ROUNDING * size + _gaps(self.candidate)
        self._scales = scales
        self._measure(self.candidate - self.reference)

    def _measure(self, difference: FloatArray) -> None:
        self._difference = difference
        self._scale = max(self._scales, key=lambda scale: scale.clearness(difference))
        self.clear = self._scale.clearness(difference) > CLEARLY
        self.excess = self._scale.excess(difference)
        """How much the squares exceed those of noise alone."""

    def beyond(self, picture: FloatArray) -> "Misfit":
        """The same, where what `picture` explains is no part of the difference."""
        found = copy.copy(self)
        found._measure(self._rest(picture))
        return found

    def seen(self, reference: FloatArray, inside: FloatArray | None = None) -> "Misfit":
        """The same of the reference seen through a warp, which shows nothing but `inside` (1 there,
        0 elsewhere): nothing else is compared."""
        found = copy.copy(self)
        found.reference = reference
        if inside is not None and not inside.all():
            found._inside = inside
            found._scales = [scale.within(inside) for scale in self._scales]
            found._scale = found._scales[self._scales.index(self._scale)]
            found._difference = inside * self._difference
            found.excess = found._scale.excess(found._difference)
        return found

    def noisier(self, variance: FloatArray) -> "Misfit":
        """The same for predicted pictures whose values have noise of this variance."""
        found = copy.copy(self)
        found._scales = [scale.noisier(variance) for scale in self._scales]
        found._measure(self._difference)
        return found

    @property
    def weights(self) -> FloatArray:
        """(height, width, 3): of single pixels."""
        return self._inside * self._scales[0].weights

    def is_whole(self, hypothesis: Hypothesis) -> bool:
        """Whether what a hypothesis leaves of the difference of pixels, and of blocks, is no more
        than noise, rounding, and how far it may be inexact."""
        left = self._rest(hypothesis.picture)
        slack = self._rounding if hypothesis.slack is None else self._rounding + hypothesis.slack()
        left = np.sign(left) * np.maximum(np.abs(left) - slack, 0.0)
        leaves = max(hypothesis.leaves, NO_MATTER)
        # What changes colours changes the noise of the reference in them.
        noise = (
            self._inside * (hypothesis.slope(self.reference) ** 2 - 1.0) * self._reference_error2
        )
        return all(
            scale.excess(left) - scale.noise_of(noise)
            <= leaves * max(scale.excess(self._difference), 0.0) + NO_MORE * scale.scatter
            for scale in self._scales
        )

    def reproduces(self, picture: FloatArray) -> bool:
        """Whether `picture` as the reference leaves no more than REST of the bias of any channel's
        mean, and of the squares at any scale of blocks at which the difference is clear."""
        before, left = self._difference, self._rest(picture)
        mean = np.abs(self.reference.mean(axis=(0, 1)))
        permitted = BIAS * divisor(mean, mean.mean())
        noise = CLEARLY * np.sqrt(self._scales[0].error2.sum(axis=(0, 1))) / (before.size // 3)
        bias, rest = (np.abs(x.mean(axis=(0, 1))) for x in (before, left))
        if np.any(rest > np.maximum(REST * bias, permitted) + noise):
            return False
        return all(
            scale.excess(left) <= REST * scale.excess(before) + CLEARLY * scale.scatter
            for scale in self._scales[1:]
            if scale.clearness(before) > CLEARLY
        )

    @property
    def margin(self) -> float:
        """The difference of two hypotheses' unexplained fractions that noise cannot make."""
        values = self._scale.error2.size
        return DISTINCT * self._scale.noise / values / self.excess

    def squares(self, picture: FloatArray) -> float:
        """The weighted squares of candidate - picture."""
        return self._scale.squares(self._rest(picture))

    def _rest(self, picture: FloatArray) -> FloatArray:
        return self._inside * (self.candidate - picture)

    def prefers(self, picture: FloatArray, other: FloatArray) -> bool:
        """Whether the candidate's pixels are clearly nearer to the former, where they differ."""
        apart = self._inside * (picture - other)
        nearer = apart * (2.0 * self.candidate - picture - other)
        weights = self._scales[0].weights
        noise = 2.0 * math.sqrt(float((weights**2 * apart**2 * self._scales[0].error2).sum()))
        return float((weights * nearer).sum()) > max(CLEARLY * noise, 1e-9)

    def left(self, picture: FloatArray) -> float:
        """The fraction of the excess that remains with `picture` as the reference; noise may make
        it negative."""
        return (self.squares(picture) - self._scale.noise) / self.excess

    def amount(self, direction: FloatArray, rest: FloatArray | None = None) -> float:
        """The least-squares factor of `direction`, added to the reference;  rest: what it explains,
        if not the pictures' difference."""
        w = self._scale.weights
        along = self._scale.binned(self._inside * direction)
        power = float((w * along**2).sum())
        rest = self.candidate - self.reference if rest is None else rest
        difference = self._scale.binned(self._inside * rest)
        return float((w * along * difference).sum()) / power if power else 0.0

    def rising(self, columns: FloatArray) -> FloatArray:
        """The factors >= 0 of (height, width, 3, columns), the same for all channels, whose sum is
        nearest to the candidate's pixels."""
        root = np.sqrt(self.weights)[..., None]
        weighted = np.concatenate([columns, self.candidate[..., None]], axis=-1) * root
        # The normal equations, whose root is as small as the number of columns.
        rows = weighted.reshape(-1, weighted.shape[-1])
        triangle = np.asarray(np.linalg.qr(rows, mode="r"))
        return np.asarray(scipy.optimize.nnls(triangle[:, :-1], triangle[:, -1])[0])

    def nearest(self, columns: FloatArray) -> FloatArray:
        """The factors of (height, width, 3, columns), the same for all channels, whose sum is
        nearest to the candidate."""
        w = self._scale.weights[..., None]
        binned = np.stack(
            [self._scale.binned(self._inside * columns[..., k]) for k in range(columns.shape[-1])],
            axis=-1,
        )
        wanted = self._scale.binned(self._inside * self.candidate)[..., None]
        rows = (np.sqrt(w) * binned).reshape(-1, columns.shape[-1])
        right = (np.sqrt(w) * wanted).ravel()
        return np.asarray(np.linalg.lstsq(rows, right, rcond=1e-9)[0])

    def regression(self, columns: FloatArray) -> FloatArray:
        """(columns, 3): the factors of (height, width, columns) whose sum is nearest to each
        channel of the candidate."""
        # Of all channels, since blocks are whole.
        inside = np.min(np.broadcast_to(self._inside, self.candidate.shape), axis=-1, keepdims=True)
        a = self._scale.binned(inside * columns).reshape(-1, columns.shape[-1])
        wanted = self._scale.binned(inside * self.candidate).reshape(-1, 3)
        roots = np.sqrt(self._scale.weights).reshape(-1, 3)
        return np.stack(
            [
                np.linalg.lstsq(a * roots[:, k, None], wanted[:, k] * roots[:, k], rcond=1e-6)[0]
                for k in range(3)
            ],
            axis=1,
        )

    def excesses(self) -> Iterator[tuple[int, FloatArray]]:
        """The block side in pixels and the excess of each block (rows, columns), for every scale
        at which the difference clearly exceeds noise."""
        for scale in self._scales:
            if scale.clearness(self._difference) > CLEARLY:
                squares = scale.binned(self._difference) ** 2 - scale.error2
                yield scale.block, np.asarray((scale.weights * squares).sum(axis=-1))


def _gaps(candidate: FloatArray) -> FloatArray | float:
    """The width of a code of 8 bits, linear or sRGB, where so few values occur that they are
    rounded."""
    if len(np.unique(candidate[..., 0])) > FEW_VALUES:
        return 0.0
    return np.asarray(np.maximum(1.0, STEEPEST * np.abs(candidate)) / (FEW_VALUES - 1))


class _Scale:
    """Sums of squares over pixels, or over blocks of them."""

    def __init__(self, block: int, error2: FloatArray, floor2: FloatArray) -> None:
        self.block, self._of_pixels = block, (error2, floor2)
        # The noise of pixels is independent and averages out; the floor does not.
        self.error2 = self.binned(error2) / block**2
        self.weights = 1.0 / (self.error2 + self.binned(floor2))
        self.noise = float((self.weights * self.error2).sum())
        self.scatter = math.sqrt(2.0 * KURTOSIS * float(((self.weights * self.error2) ** 2).sum()))

    def within(self, inside: FloatArray) -> "_Scale":
        """The same where there is no noise but `inside`, 1 there and 0 elsewhere."""
        error2, floor2 = self._of_pixels
        return _Scale(self.block, inside * error2, floor2)

    def noisier(self, variance: FloatArray) -> "_Scale":
        error2, floor2 = self._of_pixels
        return _Scale(self.block, error2 + variance, floor2)

    def binned(self, x: FloatArray) -> FloatArray:
        """Means over whole blocks; partial blocks at the edges are ignored."""
        b = self.block
        if b == 1:
            return x
        h, w = (n // b for n in x.shape[:2])
        blocks = x[: h * b, : w * b].reshape(h, b, w, b, -1)
        return np.asarray(blocks.mean(axis=(1, 3)))

    def noise_of(self, error2: FloatArray) -> float:
        """The squares of other noise, whose variance in pixels is this."""
        return float((self.weights * self.binned(error2)).sum()) / self.block**2

    def squares(self, difference: FloatArray) -> float:
        return float((self.weights * self.binned(difference) ** 2).sum())

    def excess(self, difference: FloatArray) -> float:
        """How much the squares exceed those of noise alone."""
        return self.squares(difference) - self.noise

    def clearness(self, difference: FloatArray) -> float:
        """By how many standard deviations the squares exceed those of noise."""
        return self.excess(difference) / (self.scatter + 1e-9)
