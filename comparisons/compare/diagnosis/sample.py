"""The pixels at which causes are fitted first: a cause has few parameters, which some thousands of
pixels show."""

import math

import numpy as np
import numpy.typing as npt

POINTS = 1 << 12
"""Amounts are known from so many pixels to a hundredth of a pixel in noise of a tenth of the steps
between neighbours."""


def chosen_pixels(shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
    """The flat numbers of at most POINTS pixels (rows, columns), a small picture: one at random of
    each of as many parts, all of a picture that has no more."""
    height, width = shape[:2]
    if height * width <= POINTS:
        return np.arange(height * width).reshape(height, width)
    rows = min(height, max(1, int(math.sqrt(POINTS * height / width))))
    columns = min(width, POINTS // rows)
    inside = np.random.default_rng(0).random((2, rows, columns))
    y, x = np.mgrid[:rows, :columns] + inside
    y, x = (y * height / rows).astype(np.int64), (x * width / columns).astype(np.int64)
    return np.asarray(y * width + x)
