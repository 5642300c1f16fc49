"""How well a predicted picture fits the candidate: the score of a hypothesis."""

import copy
import math
from collections.abc import Iterator

import numpy as np
import scipy
from scipy import ndimage

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.sample import chosen_pixels
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
        error2 = _at_least_around(error2)
        size = np.maximum(np.abs(self.candidate), np.abs(self.reference))
        size = ndimage.maximum_filter(size, (3, 3, 1))
        # Most of a picture may be black, and a warp may show something there.
        least = max(float(np.median(size)), FLOOR * float(size.mean()))
        floor2 = FLOOR**2 * np.maximum(size, least) ** 2 + 1e-300
        self.top = float(self.candidate.max())
        """The brightest value of the candidate."""
        self._inside: FloatArray | float = 1.0
        self._rounding = ROUNDING * size + _gaps(self.candidate)
        self._scales = _scales(error2, floor2)
        self._splines: dict[int, list[FloatArray]] = {}
        self._measure(self.candidate - self.reference)

    def _measure(self, difference: FloatArray) -> None:
        self._difference = difference
        clearness = [scale.clearness(difference) for scale in self._scales]
        self._scale = self._scales[int(np.argmax(clearness))]
        self.clear = max(clearness) > CLEARLY
        self._clear_scales = [k for k, clear in enumerate(clearness) if clear > CLEARLY]
        self.excess = self._scale.excess(difference)
        """How much the squares exceed those of noise alone."""

    def beyond(self, picture: FloatArray) -> "Misfit":
        """The same, where what `picture` explains is no part of the difference."""
        found = copy.copy(self)
        found._measure(self._rest(picture))
        return found

    def sampled(self) -> "Misfit":
        """The same at `chosen_pixels` alone; itself where these are all."""
        chosen = chosen_pixels(self.reference.shape)
        if chosen.size == self.reference.size // 3:
            return self

        def at(values: FloatArray) -> FloatArray:
            return np.asarray(values.reshape(-1, 3)[chosen])

        found = copy.copy(self)
        found.candidate, found.reference = at(self.candidate), at(self.reference)
        found._reference_error2, found._rounding = at(self._reference_error2), at(self._rounding)
        found._scales = _scales(*(at(values) for values in self._scales[0].of_pixels))
        found._splines = {}
        if not isinstance(self._inside, float):
            found._inside = at(self._inside)
        found._measure(at(self._difference))
        return found

    def splines(self, order: int) -> list[FloatArray]:
        """The reference's channels, as `ndimage.map_coordinates` takes them without `prefilter`."""
        if order not in self._splines:
            self._splines[order] = [spline(self.reference[..., k], order) for k in range(3)]
        return self._splines[order]

    def shares(self, picture: FloatArray) -> list[FloatArray]:
        """The squares that `picture` as the reference leaves beyond noise, relative to the
        difference's, of the values at each scale at which the difference is clear; none where
        nothing differs inside of what is compared."""
        scales = [self._scales[k] for k in self._clear_scales]
        total = [scale.excess(self._difference) for scale in scales]
        if min(total, default=0.0) <= 0.0:
            return []
        left = self._rest(picture)
        return [
            scale.weights * (scale.binned(left) ** 2 - scale.error2) / all_of_it
            for scale, all_of_it in zip(scales, total, strict=True)
        ]

    def seen(self, reference: FloatArray, inside: FloatArray | None = None) -> "Misfit":
        """The same of the reference seen through a warp, which shows nothing but `inside` (1 there,
        0 elsewhere): nothing else is compared."""
        found = copy.copy(self)
        found.reference, found._splines = reference, {}
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
        variance = _at_least_around(variance)
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
        leaves = max(hypothesis.leaves, NO_MATTER)
        # What changes colours changes the noise of the reference in them.
        noise = (
            self._inside * (hypothesis.slope(self.reference) ** 2 - 1.0) * self._reference_error2
        )
        permitted = [
            scale.noise_of(noise)
            + leaves * max(scale.excess(self._difference), 0.0)
            + NO_MORE * scale.scatter
            for scale in self._scales
        ]

        def is_noise(left: FloatArray) -> bool:
            return all(
                scale.excess(left) <= most
                for scale, most in zip(self._scales, permitted, strict=True)
            )

        if is_noise(left):
            return True
        slack = self._rounding if hypothesis.slack is None else self._rounding + hypothesis.slack()
        return is_noise(np.sign(left) * np.maximum(np.abs(left) - slack, 0.0))

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
        if self.excess == 0.0:  # nothing differs inside of what is compared: nothing is explained
            return 1.0
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

    def rising(self, knots: FloatArray) -> FloatArray:
        """At the knots, the values of the curve that rises everywhere, straight between two knots,
        by which the reference is nearest to the candidate's pixels."""
        steps = len(knots) - 1
        r = np.clip(self.reference, knots[0], knots[-1]).ravel()
        k = np.clip(np.searchsorted(knots, r, side="right") - 1, 0, steps - 1)
        t = (r - knots[k]) / np.diff(knots)[k]
        w, y = self.weights.ravel(), self.candidate.ravel()
        # Normal equations of the values at the knots, of which each pixel knows two.
        normal = np.zeros((steps + 1, steps + 1))
        right = np.zeros(steps + 1)
        for at, by in ((k, 1.0 - t), (k + 1, t)):
            right += np.bincount(at, w * by * y, steps + 1)
            for other, also in ((k, 1.0 - t), (k + 1, t)):
                cells = np.bincount(at * (steps + 1) + other, w * by * also, (steps + 1) ** 2)
                normal += cells.reshape(steps + 1, steps + 1)
        # Of the first value, and of the steps, which are not negative; nor is the first.
        sums = np.tril(np.ones((steps + 1, steps + 1)))
        normal, right = sums.T @ normal @ sums, sums.T @ right
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        values, vectors = np.linalg.eigh(normal / np.outer(size, size))
        root = np.sqrt(np.maximum(values, 1e-12 * values[-1]))
        rows = root[:, None] * vectors.T
        wanted = (vectors.T @ (right / size)) / root
        return np.asarray(sums @ (scipy.optimize.nnls(rows, wanted)[0] / size))

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


def _at_least_around(variance: FloatArray) -> FloatArray:
    """Few replicates estimate the variance badly; neighbouring pixels have similar ones."""
    return np.asarray(np.maximum(variance, ndimage.uniform_filter(variance, (3, 3, 1))))


def spline(channel: FloatArray, order: int) -> FloatArray:
    """The coefficients by which a picture is interpolated."""
    if order == 1:
        return np.ascontiguousarray(channel)
    return np.asarray(ndimage.spline_filter(channel, order, mode="nearest"))


def _scales(error2: FloatArray, floor2: FloatArray) -> list["_Scale"]:
    side = min(error2.shape[:2])
    return [
        _Scale(block, error2, floor2)
        for block in BLOCKS
        if block == 1 or side >= FEWEST_BLOCKS * block
    ]


def _gaps(candidate: FloatArray) -> FloatArray | float:
    """The width of a code of 8 bits, linear or sRGB, where so few values occur that they are
    rounded."""
    if len(np.unique(candidate[..., 0])) > FEW_VALUES:
        return 0.0
    return np.asarray(np.maximum(1.0, STEEPEST * np.abs(candidate)) / (FEW_VALUES - 1))


class _Scale:
    """Sums of squares over pixels, or over blocks of them."""

    def __init__(self, block: int, error2: FloatArray, floor2: FloatArray) -> None:
        self.block, self.of_pixels = block, (error2, floor2)
        # The noise of pixels is independent and averages out; the floor does not.
        self.error2 = self.binned(error2) / block**2
        self.weights = 1.0 / (self.error2 + self.binned(floor2))
        self.noise = float((self.weights * self.error2).sum())
        self.scatter = math.sqrt(2.0 * KURTOSIS * float(((self.weights * self.error2) ** 2).sum()))

    def within(self, inside: FloatArray) -> "_Scale":
        """The same where there is no noise but `inside`, 1 there and 0 elsewhere."""
        error2, floor2 = self.of_pixels
        return _Scale(self.block, inside * error2, floor2)

    def noisier(self, variance: FloatArray) -> "_Scale":
        error2, floor2 = self.of_pixels
        return _Scale(self.block, error2 + variance, floor2)

    def binned(self, x: FloatArray) -> FloatArray:
        """Means over whole blocks; partial blocks at the edges are ignored."""
        b = self.block
        if b == 1:
            return x
        h, w = (n // b for n in x.shape[:2])
        # One axis after the other: both at once take four times as long.
        rows = x[: h * b, : w * b].reshape(h, b, -1).sum(axis=1)
        return np.asarray(rows.reshape(h, w, b, -1).sum(axis=2) / b**2)

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
