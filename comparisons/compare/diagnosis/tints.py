"""The reference in the candidate's colours, whatever happened to these: positions are fitted to it.

Neither picture is a cause by itself: they have dozens of parameters.
"""

import numpy as np

from comparisons.results.case import FloatArray

LEVELS = 129
"""Quantiles by which distributions of values are made alike."""

KNOTS = 8
"""Of the curve of each channel, at quantiles; half as many up to the brightest, besides."""


def by_distribution(candidate: FloatArray, reference: FloatArray) -> FloatArray:
    """Each channel rises so that its values are distributed as the candidate's, wherever they
    are."""
    shares = np.linspace(0.0, 1.0, LEVELS)
    channels = []
    for k in range(3):
        own, first = np.unique(np.quantile(reference[..., k], shares), return_index=True)
        wanted = np.quantile(candidate[..., k], shares)[first]
        channels.append(np.interp(reference[..., k], own, wanted))
    return np.stack(channels, axis=-1)


class Tint:
    """Each channel of the candidate as a sum of curves of the reference's three.

    values, wanted (pixels, 3): what these show in the reference and in the candidate; NaN in those
    that are left out;  weights: as wanted.
    """

    def __init__(self, values: FloatArray, wanted: FloatArray, weights: FloatArray) -> None:
        known = np.isfinite(values).all(axis=1)
        values, wanted, weights = values[known], wanted[known], weights[known]
        self._knots = [_knots(values[:, k]) for k in range(3)]
        rows = self._columns(values)
        scale = np.sqrt((rows**2).mean(axis=0))
        scale = np.where(
            scale > 1e-6 * scale.max(), scale, np.inf
        )  # what is never met changes nothing
        rows /= scale
        factors = []
        self.squares = 0.0
        """The mean square that is left, weighted."""
        for k in range(3):
            weighted = rows * weights[:, k, None]
            normal, right = weighted.T @ rows, weighted.T @ wanted[:, k]
            factors.append(np.linalg.lstsq(normal, right, rcond=1e-9)[0])
            rest = wanted[:, k] - rows @ factors[-1]
            self.squares += float((weights[:, k] * rest**2).mean())
        self._factors = np.stack(factors, axis=1) / scale[:, None]

    def _columns(self, values: FloatArray) -> FloatArray:
        parts = [np.ones((*values.shape[:-1], 1))]
        for k, knots in enumerate(self._knots):
            parts.append(np.clip(values[..., k, None] - knots[:-1], 0.0, np.diff(knots)))
        return np.concatenate(parts, axis=-1)

    def of(self, picture: FloatArray) -> FloatArray:
        return np.asarray(self._columns(picture) @ self._factors)


def _knots(values: FloatArray) -> FloatArray:
    even = np.linspace(0.0, 1.0, KNOTS + 1)
    return np.unique([*np.quantile(values, even), *(values.min() + even[::2] * np.ptp(values))])
