"""A hypothesis about what is wrong with a picture."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from comparisons.results.case import FloatArray

STEP = 1e-3
"""Relative, by which brightness is changed."""


@dataclass(frozen=True)
class Hypothesis:
    """family: hypotheses of the same family do not compete;  name, evidence: as in `Cause`;
    picture: the candidate that the hypothesis predicts;  parameters: how many were fitted.

    leaves: the fraction of the squared difference by which the picture may be inexact, besides
    noise;  slack: returns how far its values may be off, of the picture's shape;
    noise: the variance of its values;  of: the colours of any picture, where what happens depends
    on nothing but the colours of a pixel.
    """

    family: str
    name: str
    evidence: str
    picture: FloatArray
    parameters: int
    leaves: float = 0.0
    slack: Callable[[], FloatArray] | None = None
    noise: FloatArray | None = None
    of: Callable[[FloatArray], FloatArray] | None = None

    def slope(self, reference: FloatArray) -> FloatArray | float:
        """How much more than the reference its picture changes with brightness."""
        if self.of is None:
            return 1.0
        brighter = (1.0 + STEP) * reference
        change = STEP * reference
        return np.where(
            change > 0.0,
            (self.of(brighter) - self.picture) / np.where(change > 0.0, change, 1.0),
            1.0,
        )


def of_pixels(
    family: str,
    name: str,
    evidence: str,
    of: Callable[[FloatArray], FloatArray],
    reference: FloatArray,
    parameters: int,
) -> Hypothesis:
    """What happens to the colours of each pixel of the reference."""
    return Hypothesis(family, name, evidence, of(reference), parameters, of=of)
