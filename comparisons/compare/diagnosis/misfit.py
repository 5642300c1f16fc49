"""How well a picture made from the reference fits the candidate: what hypotheses are judged by."""

import math
from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from comparisons.results.case import FloatArray, Images

FLOOR = 0.005
"""Of a pixel's brightness, or of the picture's where that is brighter: differences below it weigh
little, so that dark pixels and noise-free ones do not have all the say."""

BLOCKS = (1, 8, 32)
"""Pixels: sums over blocks show what is wrong with brightness in more noise than pixels do."""

FEWEST_BLOCKS = 3
"""Along either side: with fewer, hypotheses look alike."""

KURTOSIS = 3.0
"""How much more than those of Gaussian noise squares of real noise scatter, as a variance."""

CLEARLY = 6.0
"""Standard deviations by which a difference must exceed noise before a cause is looked for."""


DISTINCT = 50.0
"""Of the noise of one value: squares that differ by so much tell two fits apart.  The difference of
two is as of four standard deviations, of noise with KURTOSIS."""


class Misfit:
    """The weighted squared difference between the candidate and what is made of the reference, by
    pixels or by blocks: whichever shows more that there is more than noise.

    The weights are one over the variance of the noise and of FLOOR.
    """

    def __init__(self, images: Images) -> None:
        self.candidate, self.reference = images.candidate, images.reference
        error2 = np.zeros_like(self.reference) if images.error is None else images.error**2
        # A few replicates know their variance badly; neighbours have much the same.
        error2 = np.maximum(error2, ndimage.uniform_filter(error2, (3, 3, 1)))
        size = np.maximum(np.abs(self.candidate), np.abs(self.reference))
        size = ndimage.maximum_filter(size, (3, 3, 1))
        floor2 = FLOOR**2 * np.maximum(size, np.median(size)) ** 2 + 1e-300
        side = min(error2.shape[:2])
        scales = [
            _Scale(block, error2, floor2)
            for block in BLOCKS
            if block == 1 or side >= FEWEST_BLOCKS * block
        ]
        difference = self.candidate - self.reference
        self._scales = scales
        self._scale = max(scales, key=lambda scale: scale.clearness(difference))
        self.clear = self._scale.clearness(difference) > CLEARLY
        self.excess = self._scale.squares(difference) - self._scale.noise
        """Of the squares over what noise alone gives."""

    @property
    def margin(self) -> float:
        """How much less than another a hypothesis must leave unexplained for noise not to have made
        the difference."""
        values = self._scale.error2.size
        return DISTINCT * self._scale.noise / values / self.excess

    def squares(self, picture: FloatArray) -> float:
        """Of the candidate less a picture."""
        return self._scale.squares(self.candidate - picture)

    def left(self, picture: FloatArray) -> float:
        """The fraction of the excess that is left with a picture in the reference's place; noise
        may make it less than zero."""
        return (self.squares(picture) - self._scale.noise) / self.excess

    def amount(self, direction: FloatArray) -> float:
        """How much of `direction`, added to the reference, fits best (least squares)."""
        w = self._scale.weights
        along = self._scale.binned(direction)
        power = float((w * along**2).sum())
        difference = self._scale.binned(self.candidate - self.reference)
        return float((w * along * difference).sum()) / power if power else 0.0

    def excesses(self) -> Iterator[tuple[int, FloatArray]]:
        """The side of blocks, in pixels, and the excess of each (rows, columns), on every scale
        that shows more than noise."""
        difference = self.candidate - self.reference
        for scale in self._scales:
            if scale.clearness(difference) > CLEARLY:
                found = scale.binned(difference) ** 2 - scale.error2
                yield scale.block, np.asarray((scale.weights * found).sum(axis=-1))


class _Scale:
    """Sums of squares over pixels, or over blocks of them."""

    def __init__(self, block: int, error2: FloatArray, floor2: FloatArray) -> None:
        self.block = block
        # Noise of pixels is independent; the floor's part is not, and does not average out.
        self.error2 = self.binned(error2) / block**2
        self.weights = 1.0 / (self.error2 + self.binned(floor2))
        self.noise = float((self.weights * self.error2).sum())
        self.scatter = math.sqrt(2.0 * KURTOSIS * float(((self.weights * self.error2) ** 2).sum()))

    def binned(self, x: FloatArray) -> FloatArray:
        """Means over whole blocks; what is left over at the edges is not looked at."""
        b = self.block
        if b == 1:
            return x
        h, w = (n // b for n in x.shape[:2])
        blocks = x[: h * b, : w * b].reshape(h, b, w, b, -1)
        return np.asarray(blocks.mean(axis=(1, 3)))

    def squares(self, difference: FloatArray) -> float:
        return float((self.weights * self.binned(difference) ** 2).sum())

    def clearness(self, difference: FloatArray) -> float:
        """By how many standard deviations the squares exceed those of noise."""
        excess = self.squares(difference) - self.noise
        return excess / (self.scatter + 1e-9)
