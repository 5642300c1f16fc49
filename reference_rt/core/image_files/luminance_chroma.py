"""Luminance and chroma of OpenEXR images: Y of every pixel, RY = (R - Y) / Y and BY = (B - Y) / Y
of every second one in both directions (Technical Introduction to OpenEXR, "Luminance/Chroma
images").

Between its samples chroma is a half-band filter of 14 of them along each axis, with the weights
that the reader of OpenEXR itself has; beyond the border the last sample repeats.  A smooth picture
comes back to 0.1 %.  That reader's cure of saturated pixels is left out.  Where the filter
overshoots, colours below 0 become 0.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray

Planes = npt.NDArray[Any]

_WEIGHTS = (0.627123, -0.186077, 0.087929, -0.043159, 0.019597, -0.007540, 0.002128)
"""Of the samples before and after a place between two, the nearest first; half of their sum is
1/2."""

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x and y of red, green, blue and white: where the header has no others."""


def luminance_weights(chromaticities: Sequence[float]) -> FloatArray:
    """(3,): of red, green and blue in Y, which sum to 1.  Raises ValueError."""
    x, y = np.asarray(chromaticities, np.float64).reshape(4, 2).T
    xyz = np.stack([x, y, 1.0 - x - y])  # columns: the primaries, white
    try:
        with np.errstate(all="ignore"):
            # White is the sum of the primaries, each times its weight over its y.
            amounts = np.linalg.solve(xyz[:, :3], xyz[:, 3] / y[3])
    except np.linalg.LinAlgError:
        amounts = np.full(3, np.nan)
    weights = amounts * y[:3]
    if not (np.isfinite(weights).all() and weights.min() > 0.0):
        raise ValueError("has primaries that span no colours; expected other chromaticities")
    return np.asarray(weights)


def colours(
    luminance: Planes, red: Planes, blue: Planes, rows: slice, weights: FloatArray
) -> npt.NDArray[np.float32]:
    """(rows, width, 3) of some rows of an image.

    luminance (height, width);  red, blue: of half the height and width, or whole;  weights: of
    `luminance_weights`.
    """
    y = luminance[rows].astype(np.float64)
    r, b = (_between(plane, luminance.shape, rows) for plane in (red, blue))
    r, b = (r + 1.0) * y, (b + 1.0) * y
    g = (y - weights[0] * r - weights[2] * b) / weights[1]
    found = np.stack([r, g, b], axis=-1)
    return np.asarray(np.where(found < 0.0, 0.0, found).astype(np.float32))


def _between(plane: Planes, shape: tuple[int, ...], rows: slice) -> FloatArray:
    """The values of some rows, at every pixel."""
    height, width = shape
    found = plane
    if plane.shape[0] == height:
        found = found[rows]
    else:
        found = _halves(found.T, np.arange(rows.start, rows.stop)).T
    found = found.astype(np.float64)
    return found if plane.shape[1] == width else _halves(found, np.arange(width))


def _halves(samples: Planes, places: npt.NDArray[np.int64]) -> FloatArray:
    """(n, places): samples (n, m) stand at the even places."""
    last = samples.shape[1] - 1
    at, is_odd = places // 2, places % 2 == 1
    total = samples[:, at].astype(np.float64)
    total[:, is_odd] = 0.0
    for k, weight in enumerate(_WEIGHTS):
        before, after = np.maximum(at[is_odd] - k, 0), np.minimum(at[is_odd] + 1 + k, last)
        pair = samples[:, before].astype(np.float64) + samples[:, after]
        total[:, is_odd] += weight * pair
    return total
