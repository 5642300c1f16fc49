"""Signal: reconstruction filters, gratings, and what sampling makes of steps."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case
from comparisons.truth.film import coverage, mix

WARM = np.array([1.0, 0.5, 0.2])
PIXELS = 32

BARS = ((6.125, 8.5), (11.25, 11.75), (15.375, 20.0), (22.6, 23.1))
"""Edges of the bars that shine, in pixels: at eighths, narrower than a pixel, and wide."""

RIM = 5
"""Pixels that are left out along the border, where filters reach beyond the film."""

Kernel = Callable[[FloatArray], FloatArray]


def _bars(kernel: Kernel, radius: float) -> Expected:
    """Vertical bars through a separable filter, normalised: K(edge - middle of pixel) summed with
    signs, K the integral of the kernel.  Gauss's rule on each half pixel between its knots."""
    nodes, weights = np.polynomial.legendre.leggauss(24)

    def integral(low: Any, high: Any) -> FloatArray:
        knots = np.unique(np.concatenate([np.arange(-8.0, 8.01, 0.5), [-radius, radius]]))
        total: FloatArray = np.zeros(len(low))
        for a, b in pairwise(knots):
            left, right = np.clip(low, a, b), np.clip(high, a, b)
            t = left[:, None] + (right - left)[:, None] * (nodes + 1.0) / 2.0
            inside = np.where(np.abs(t) <= radius, kernel(t), 0.0)
            total += inside @ weights * (right - left) / 2.0
        return total

    middle = np.arange(PIXELS) + 0.5
    whole = integral(np.array([-radius]), np.array([radius]))
    columns = np.sum([integral(a - middle, b - middle) for a, b in BARS], axis=0) / whole
    pixels = np.full((PIXELS, PIXELS, 3), np.nan)
    pixels[RIM:-RIM, RIM:-RIM] = (columns[:, None] * WARM)[RIM:-RIM]
    # Pictures that divide by the sum of the samples' weights are off by half a part in samples.
    return Expected(pixels, 5e-4)


FILTER = r"$L \int k(x) dx$ over the bars, $k$ the filter's kernel"


@case(FILTER, "the box filter")
def box_filter() -> Expected:
    """The mean over the pixel's square."""
    return _bars(lambda t: np.ones_like(t), 0.5)


@case(FILTER, "the tent filter")
def tent_filter() -> Expected:
    """1 - |t| within one pixel."""
    return _bars(lambda t: 1.0 - np.abs(t), 1.0)


@case(FILTER, "the Gaussian filter")
def gaussian_filter() -> Expected:
    """exp(-2 t^2), a standard deviation of half a pixel, lowered to reach 0 at two pixels."""
    return _bars(lambda t: np.exp(-2.0 * t * t) - np.exp(-8.0), 2.0)


def _cubic(b: float, c: float) -> Kernel:
    def kernel(t: FloatArray) -> FloatArray:
        x = np.abs(t)
        near = (12 - 9 * b - 6 * c) * x**3 + (-18 + 12 * b + 6 * c) * x**2 + (6 - 2 * b)
        far = (
            (-b - 6 * c) * x**3 + (6 * b + 30 * c) * x**2 + (-12 * b - 48 * c) * x + 8 * b + 24 * c
        )
        return np.asarray(np.where(x < 1.0, near, far) / 6.0)

    return kernel


@case(FILTER, "Mitchell's filter", "Mitchell & Netravali 1988, eq. 8")
def mitchell_filter() -> Expected:
    """Two cubics on each side, B = C = 1/3, with lobes below 0."""
    return _bars(_cubic(1.0 / 3.0, 1.0 / 3.0), 2.0)


@case(FILTER, "the Catmull-Rom filter", "Mitchell & Netravali 1988, eq. 8")
def catmull_rom_filter() -> Expected:
    """The same with B = 0 and C = 1/2."""
    return _bars(_cubic(0.0, 0.5), 2.0)


@case(FILTER, "the Lanczos filter", "Duchon 1979")
def lanczos_filter() -> Expected:
    """sinc(t) sinc(t / 3) within three pixels."""
    return _bars(lambda t: np.sinc(t) * np.sinc(t / 3.0), 3.0)


@case(
    r"$L w$, $w$ the share of each pixel's width in bright bars",
    "a grating near the limit of resolution",
)
def grating() -> Expected:
    """A square wave of 0.45 cycles a pixel: the filter leaves the beat of 0.05 with the grid, and
    its contrast."""
    edges = np.arange(0.0, 80.0) / 0.9
    x = np.arange(PIXELS + 1)[:, None]
    bright = np.clip(x - edges[::2], 0.0, edges[1] - edges[0]).sum(axis=1)
    columns = np.diff(bright)
    return Expected(mix(np.repeat(columns[None], PIXELS, axis=0), WARM, 0.2 * WARM))


@case(r"$L A$, $A$ the area of wedges in the pixel", "edges of every slope")
def wedges() -> Expected:
    """Twelve triangles with one corner in common."""
    share = np.zeros((PIXELS, PIXELS))
    for k in range(12):
        angle = np.pi * np.array([k, k + 0.5]) / 6.0 + 0.1
        corners = np.stack([np.cos(angle), -np.sin(angle)], axis=1) * 14.0 + 16.0
        share += coverage(np.concatenate([[[16.0, 16.0]], corners]), PIXELS, PIXELS)
    return Expected(mix(share, WARM))
