"""Differences that are confined to one place: a row, column, tile or a few pixels."""

import numpy as np
import numpy.typing as npt

from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.results.case import Cause, FloatArray

SHARE = 0.9
"""The fraction of the excess that must lie in the place."""

ONE_TILE, FEW_PIXELS, ONE_PIXEL = "one bad tile", "a few wrong pixels", "a single wrong pixel"
"""Names of causes."""

FEW = 1e-3
"""The fraction of all pixels up to which wrong pixels are called few."""

SMALL = 0.1
"""The fraction of the picture up to which a rectangle is called a tile."""


def one_place(misfit: Misfit) -> Cause | None:
    """The row, column, rectangle or few pixels in which the difference lies, if it does."""
    for block, excess in misfit.excesses():
        total = float(excess.sum())
        places = [_rectangle(excess, total, block)]
        if block == 1:
            places = [_line(excess, total), _pixels(excess, total), *places]
        for place in places:
            if place is not None and _holds(misfit, place[1], block):
                return place[0]
    return None


Place = tuple[Cause, npt.NDArray[np.bool_]]
"""A cause, and the blocks (rows, columns) in which the difference lies."""


def _holds(misfit: Misfit, blocks: npt.NDArray[np.bool_], block: int) -> bool:
    """Whether the difference in the place makes the bias of each channel, and those of blocks."""
    height, width = misfit.reference.shape[:2]
    at = [
        np.minimum(np.arange(n) // block, m - 1)
        for n, m in zip((height, width), blocks.shape, strict=True)
    ]
    inside = blocks[np.ix_(*at)][..., None]
    return misfit.reproduces(np.where(inside, misfit.candidate, misfit.reference))


def rim(misfit: Misfit) -> Cause | None:
    """The rim of the picture, on three sides at least, if it holds the difference: renderers treat
    a wide filter at the border in two ways."""
    for block, excess in misfit.excesses():
        total = float(excess.sum())
        for width in range(1, WIDEST_RIM // block + 1):
            inner = excess[width:-width, width:-width]
            if 2 * width >= min(excess.shape) or inner.size < INNER * excess.size:
                break
            share = 1.0 - float(inner.sum()) / total
            # Corners belong to two sides, and a wrong column has ends in the upper and the lower.
            up, across = excess[:, width:-width], excess[width:-width]
            sides = (up[:width], up[-width:], across[:, :width], across[:, -width:])
            sums = sorted(float(side.sum()) for side in sides)
            if share > SHARE and sums[1] > ON_A_SIDE * total:
                pixels = width * block
                outer = np.ones(excess.shape, dtype=np.bool_)
                outer[width:-width, width:-width] = False
                if not _holds(misfit, outer, block):
                    continue
                evidence = (
                    f"{_percent(share)} of the difference are within {pixels} px of the border: "
                    "some renderers take samples beyond it for a filter wider than a pixel, others "
                    "do not; use a filter of one pixel, or leave its radius out by --rim"
                )
                return Cause("filter at the picture's border", evidence, min(share, 1.0))
    return None


WIDEST_RIM = 8
"""Width in pixels up to which a rim is sought: filters have radii of 4 at most; in much noise only
blocks of 8 pixels show it."""

INNER = 0.4
"""Least fraction of the picture inside a rim."""

ON_A_SIDE = 0.05
"""Least fraction of the difference on each of three sides."""


def _line(excess: FloatArray, total: float) -> Place | None:
    for axis, name in ((1, "row"), (0, "column")):
        sums = excess.sum(axis=axis)
        k = int(np.argmax(sums))
        share = float(sums[k]) / total
        along = excess[k] if axis == 1 else excess[:, k]
        # The whole line must be wrong, not only a pixel or two in it.
        if share > SHARE and np.median(along) > EVEN * along.mean():
            evidence = f"{_percent(share)} of the difference are in {name} {k}"
            inside = np.zeros(excess.shape, dtype=np.bool_)
            inside[(k, slice(None)) if axis == 1 else (slice(None), k)] = True
            return Cause(f"one bad {name}", evidence, min(share, 1.0)), inside
    return None


EVEN = 0.05
"""The least median difference along a wrong line, relative to the mean."""


def _percent(share: float) -> str:
    return f"{100.0 * min(share, 1.0):.0f} %"


def _pixels(excess: FloatArray, total: float) -> Place | None:
    count = max(1, int(FEW * excess.size))
    order = np.argsort(excess, axis=None)[::-1][:count]
    shares = np.cumsum(excess.ravel()[order]) / total
    if shares[-1] < SHARE:
        return None
    needed = int(np.argmax(shares >= SHARE)) + 1
    y, x = (int(i) for i in np.unravel_index(int(order[0]), excess.shape))
    share = min(float(shares[-1]), 1.0)
    many = "one pixel" if needed == 1 else f"{needed} pixels"
    evidence = f"{_percent(share)} of the difference are in {many}, the worst at x {x}, y {y}"
    inside = np.zeros(excess.shape, dtype=np.bool_)
    inside.flat[order] = True
    name = ONE_PIXEL if needed == 1 else FEW_PIXELS
    return Cause(name, evidence, share), inside


def _rectangle(excess: FloatArray, total: float, block: int) -> Place | None:
    """The rectangle of rows and columns that holds the difference, without the tails."""
    tail = 0.5 * (1.0 - SHARE) / 2.0
    edges = []
    for axis in (0, 1):
        sums = np.cumsum(excess.sum(axis=axis)) / total
        edges.append((int(np.argmax(sums > tail)), int(np.argmax(sums > 1.0 - tail)) + 1))
    (left, right), (top, bottom) = edges
    inside = float(excess[top:bottom, left:right].sum()) / total
    width, height = right - left, bottom - top
    if not (inside > SHARE and 0.0 < width * height < SMALL * excess.size):
        return None
    evidence = (
        f"{_percent(inside)} of the difference are in the {width * block} x {height * block} "
        f"pixels at x {left * block}, y {top * block}"
    )
    thin = block == 1 and 1 in (width, height) and max(width, height) > 8
    name = ("one bad row" if height == 1 else "one bad column") if thin else ONE_TILE
    blocks = np.zeros(excess.shape, dtype=np.bool_)
    blocks[top:bottom, left:right] = True
    return Cause(name, evidence, min(inside, 1.0)), blocks
