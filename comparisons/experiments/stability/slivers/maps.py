"""Maps of a triangle: the outcome of the ray that is aimed at each of its points."""

import numpy as np

from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.experiments.stability.harness.shots import Shot, pixel_grid
from comparisons.geometry.exact.dyadic import BoolArray

PIXELS = 192

RIGHT, LOST, FALSE, OFF = (70, 110, 150), (250, 250, 250), (240, 160, 40), (200, 40, 40)


def targets() -> FloatArray:
    """Barycentrics (PIXELS², 3) of a picture in which any triangle has its vertices near the lower
    corners and the middle of the upper edge."""
    x, y = pixel_grid(PIXELS, 1.2)
    top = 0.5 * (y + 1.0)
    right = 0.5 * (x + 1.0 - top)
    return np.stack([1.0 - top - right, right, top], axis=-1)


def picture(expected: FloatArray, found: FloatArray, wrong: BoolArray, caption: str) -> Shot:
    """expected, found (PIXELS²,): t, inf for misses;  wrong: which break the law."""
    pixels = np.full((PIXELS * PIXELS, 3), 20, np.uint8)
    hit, there = np.isfinite(found), np.isfinite(expected)
    pixels[hit] = RIGHT
    pixels[wrong & hit & there] = OFF
    pixels[wrong & hit & ~there] = FALSE
    pixels[wrong & ~hit] = LOST
    counts = [
        f"{int(which.sum())} {word}"
        for which, word in (
            (wrong & ~hit, "lost (white)"),
            (wrong & hit & ~there, "false (orange)"),
            (wrong & hit & there, "elsewhere (red)"),
        )
    ]
    return Shot(pixels.reshape(PIXELS, PIXELS, 3), f"{caption}: {', '.join(counts)}.")
