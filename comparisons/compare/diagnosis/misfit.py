"""How well a predicted picture fits the candidate: the score of a hypothesis."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from comparisons.results.case import FloatArray, Images

# ---- a hypothesis about what is wrong with a picture ---------------------------------------------


@dataclass(frozen=True)
class Hypothesis:
    """family: hypotheses of the same family do not compete;  name, evidence: as in `Cause`;
    picture: the candidate that the hypothesis predicts;  parameters: how many were fitted."""

    family: str
    name: str
    evidence: str
    picture: FloatArray
    parameters: int


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


DISTINCT = 50.0
"""Two fits are distinguished if their squares differ by this many times the noise of one value:
about four standard deviations of the difference, for noise with KURTOSIS."""


class Misfit:
    """The weighted squared difference between the candidate and a predicted picture, over pixels or
    blocks: the scale at which the difference exceeds the noise most clearly.

    The weights are 1 / (variance of the noise + FLOOR's).
    """

    def __init__(self, images: Images) -> None:
        self.candidate, self.reference = images.candidate, images.reference
        error2 = np.zeros_like(self.reference) if images.error is None else images.error**2
        # Few replicates estimate the variance badly; neighbouring pixels have similar ones.
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
        """How much the squares exceed those of noise alone."""

    @property
    def margin(self) -> float:
        """The difference of two hypotheses' unexplained fractions that noise cannot make."""
        values = self._scale.error2.size
        return DISTINCT * self._scale.noise / values / self.excess

    def squares(self, picture: FloatArray) -> float:
        """The weighted squares of candidate - picture."""
        return self._scale.squares(self.candidate - picture)

    def left(self, picture: FloatArray) -> float:
        """The fraction of the excess that remains with `picture` as the reference; noise may make
        it negative."""
        return (self.squares(picture) - self._scale.noise) / self.excess

    def amount(self, direction: FloatArray) -> float:
        """The least-squares factor of `direction`, added to the reference."""
        w = self._scale.weights
        along = self._scale.binned(direction)
        power = float((w * along**2).sum())
        difference = self._scale.binned(self.candidate - self.reference)
        return float((w * along * difference).sum()) / power if power else 0.0

    def excesses(self) -> Iterator[tuple[int, FloatArray]]:
        """The block side in pixels and the excess of each block (rows, columns), for every scale
        at which the difference clearly exceeds noise."""
        difference = self.candidate - self.reference
        for scale in self._scales:
            if scale.clearness(difference) > CLEARLY:
                found = scale.binned(difference) ** 2 - scale.error2
                yield scale.block, np.asarray((scale.weights * found).sum(axis=-1))


class _Scale:
    """Sums of squares over pixels, or over blocks of them."""

    def __init__(self, block: int, error2: FloatArray, floor2: FloatArray) -> None:
        self.block = block
        # The noise of pixels is independent and averages out; the floor does not.
        self.error2 = self.binned(error2) / block**2
        self.weights = 1.0 / (self.error2 + self.binned(floor2))
        self.noise = float((self.weights * self.error2).sum())
        self.scatter = math.sqrt(2.0 * KURTOSIS * float(((self.weights * self.error2) ** 2).sum()))

    def binned(self, x: FloatArray) -> FloatArray:
        """Means over whole blocks; partial blocks at the edges are ignored."""
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
