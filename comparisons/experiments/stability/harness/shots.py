"""Pictures of failures."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.experiments.stability.harness.outcomes import FloatArray


class Shot(NamedTuple):
    """An image of a failure: pixels (height, width, 3) uint8 sRGB, row 0 on top, and one sentence
    that says what is to be seen."""

    pixels: npt.NDArray[np.uint8]
    caption: str


def pixel_grid(pixels: int, half: float) -> tuple[FloatArray, FloatArray]:
    """x, y (pixels², ) of the middles of a picture's pixels, from -half to half; row 0 on top."""
    ticks = (np.arange(pixels) + 0.5) / pixels * (2.0 * half) - half
    x, y = np.meshgrid(ticks, -ticks)
    return x.ravel(), y.ravel()
