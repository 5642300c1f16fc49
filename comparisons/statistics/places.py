"""Where two pictures differ beyond their noise."""

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray, ImageRegion
from comparisons.statistics.cells import (
    CHANNELS,
    ROUNDING,
    TILE,
    Margins,
    cell_means,
    divisor,
)
from comparisons.statistics.decide import findings
from comparisons.statistics.metrics import ratio
from comparisons.statistics.reading import read
from comparisons.statistics.scales import PIXELS, Pair, pixel_test
from comparisons.statistics.sides import Known, neighbourhood, side_of
from comparisons.statistics.welch import BiasTest
from comparisons.statistics.wording import percent

NOTABLE = 0.5
"""Least strength (`BiasTest.strength`, 1 is a proof) of a tile that is listed. It is about three
standard errors, which one tile in three hundred reaches by chance."""


def standard_error(candidate: npt.ArrayLike, reference: npt.ArrayLike | Known) -> FloatArray:
    """The standard error of each pixel's difference of means, (height, width, 3), for maps of z.

    The larger of the estimates from the pixel's replicates and from its neighbours, and never less
    than the rounding of float32; if a side is a single picture, from the difference around the
    pixel.  Pixels that are not finite count as black.  Arguments as for `compare`; raises
    ValueError for pictures of different sizes.
    """
    a, b = read(candidate, reference, finite=False)
    if len(a) > 1 and (isinstance(b, Known) or len(b) > 1):
        pair = Pair(side_of(a), side_of(b), Margins())
        return pixel_test(pair, PIXELS.level).standard_error
    mean = b.mean if isinstance(b, Known) else b.mean(axis=0)
    difference = a.mean(axis=0) - mean
    variance = neighbourhood(difference**2) - neighbourhood(difference) ** 2
    return np.sqrt(np.maximum(variance, (ROUNDING * mean) ** 2))


def worst_regions(
    candidate: npt.ArrayLike, reference: npt.ArrayLike | Known, *, tile: int = TILE, most: int = 6
) -> tuple[ImageRegion, ...]:
    """The tiles that differ most beyond their noise, or hold pixels that do, the worst first.

    Tiles below NOTABLE are left out.  For two single pictures: the tiles with the largest squared
    difference.  Arguments as for `compare`; raises ValueError for pictures that are not finite or
    of different sizes.
    """
    a, b = read(candidate, reference)
    if not isinstance(b, Known) and len(a) == len(b) == 1:
        return _of_single_pictures(a[0], b[0], tile, most)
    tested = findings(a, b, tile, Margins())
    side, tiles, pixels = tested.tile, tested.tests["tiles"], tested.tests["pixels"]
    worst_pixels = _cell_maxima(pixels.strength, side)
    strength = np.maximum(tiles.strength, worst_pixels)
    places = []
    for row, column in _first(strength.max(axis=-1), most, NOTABLE):
        x, y = column * side, row * side
        channel = int(strength[row, column].argmax())
        if tiles.strength[row, column, channel] >= worst_pixels[row, column, channel]:
            what = _words(tiles, (row, column, channel))
        else:
            inside = pixels.strength[y : y + side, x : x + side, channel]
            v, u = (int(i) for i in np.unravel_index(inside.argmax(), inside.shape))
            what = f"pixel {x + u}, {y + v}: {_words(pixels, (y + v, x + u, channel))}"
        places.append(_place(a.shape, x, y, side, what))
    return tuple(places)


def _of_single_pictures(
    a: FloatArray, b: FloatArray, tile: int, most: int
) -> tuple[ImageRegion, ...]:
    rms = np.sqrt(cell_means((a - b) ** 2, tile))
    bias = cell_means(a - b, tile)
    scale = divisor(cell_means(b, tile), float(b.mean()))
    places = []
    for row, column in _first(rms.max(axis=-1), most, np.finfo(np.float64).tiny):
        at = row, column, int(rms[row, column].argmax())
        what = (
            f"{percent(float(ratio(bias, scale)[at]), sign=True)} in {CHANNELS[at[2]]}, pixels "
            f"differ by {percent(float(ratio(rms, scale)[at]))} (RMS)"
        )
        places.append(_place((1, *a.shape), column * tile, row * tile, tile, what))
    return tuple(places)


def _words(test: BiasTest, at: tuple[int, ...]) -> str:
    error = test.standard_error[at]
    bias = percent(float(test.relative[at]), sign=True)
    if error <= 2.0 * ROUNDING * test.scale[at]:
        return f"{bias} in {CHANNELS[at[-1]]}, where there is no noise"
    return f"{bias} in {CHANNELS[at[-1]]}, {abs(test.difference[at]) / error:.3g} standard errors"


def _first(values: FloatArray, most: int, least: float) -> list[tuple[int, int]]:
    """The indices of the `most` largest of (rows, columns) that are at least `least`."""
    order = np.argsort(-values, axis=None, kind="stable")[:most]
    indices = [np.unravel_index(i, values.shape) for i in order]
    return [(int(row), int(column)) for row, column in indices if values[row, column] >= least]


def _cell_maxima(values: FloatArray, tile: int) -> FloatArray:
    rows = np.maximum.reduceat(values, np.arange(0, values.shape[0], tile), axis=0)
    return np.asarray(np.maximum.reduceat(rows, np.arange(0, values.shape[1], tile), axis=1))


def _place(shape: tuple[int, ...], x: int, y: int, side: int, what: str) -> ImageRegion:
    return ImageRegion(x, y, min(side, shape[2] - x), min(side, shape[1] - y), what)
