"""Whether replicates depend on their order, and whether two sides share noise.

Pictures that go on from each other depend on their order: a history (nine tenths of the last
picture and one tenth of new samples), prefixes of one accumulation, and pixels that are seeded by
the seed plus the pixel's number, for which the picture of the next seed is the last one moved by a
pixel. The spread of such replicates does not show the error of their mean.

Independent replicates of one renderer are exchangeable: any order of them is equally likely. So the
sum of the correlations of successive pictures (lag 1) is compared with those of the same pictures
in other orders (Dwass 1957: exact for any number of random orders). The level is exact whatever the
noise is: heavy tails, filters, pixels that share random numbers. The movement for which pictures
are compared is the one with the largest correlation of any two, which does not depend on the order.

If the means of two sides differ by less than independent replicates permit, either the sides share
noise, as the same seeds do, or the replicates of a side make up for each other, as strata of one
pattern do. The former have deviations that are correlated in the pixels where they belong; the
latter have none.
"""

import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray

ORDER_LEVEL = 5e-5
"""Chance of a false alarm for the replicates of a side."""

FEWEST = 8
"""Fewer replicates have too few orders: of 7 one order and its reverse are one in 2,520."""

MOST = 16
"""Replicates that are tested, the first of more: these show any such dependence."""

ORDERS = 40_000
"""Random orders of more than FEWEST replicates: the level allows one of them to be as extreme."""

MATTERS = 0.1
"""Least correlation of successive pictures, beyond that of any two, that is reported. At 0.1 the
standard error of the mean is understated by 9 %: the variance of a mean of many is 1 + 2 * 0.1
times as large."""

ALIKE = 0.05
"""Correlation from which pictures at some distance in the order are alike, if successive ones make
up for each other. Of independent ones it is a little below 0: they deviate from their own mean."""

CROP = 128
"""Side in pixels of the middle of the picture, in which a movement is sought."""


@dataclass(frozen=True)
class Successive:
    """correlation: of successive pictures, minus that of any two;  movement: in pixels to the right
    and down, by which the second is moved;  makes_up: whether they make up for each other, as
    antithetic pairs do, and none are alike.  The error of their mean is then smaller than their
    spread shows."""

    correlation: float
    movement: tuple[int, int]
    makes_up: bool = False


def successive(pictures: FloatArray) -> Successive | None:
    """How each picture of (R, height, width, 3) depends on the one before; None if none does, or if
    there are too few to tell."""
    if len(pictures) < FEWEST:
        return None
    z = deviations(pictures[:MOST])
    if not all(picture.any() for picture in z):
        return None
    correlations = {(0, 0): _correlations(z, z)}
    middle = _middle(z.sum(axis=-1))
    spectra = np.fft.rfft2(middle)
    height, width = middle.shape[1:]
    x, y = _movement(spectra, (height, width))
    phase = np.exp(
        2j * math.pi * (y * np.fft.fftfreq(height)[:, None] + x * np.fft.rfftfreq(width))
    )
    moved = np.fft.irfft2(spectra * phase, (height, width))
    correlations[x, y] = _correlations(middle, moved)
    excess = {by: _about_mean(pairs) for by, pairs in correlations.items()}
    orders = _orders(len(z))
    in_order = {by: _of_order(x, np.arange(len(z))[None])[:, 0] for by, x in excess.items()}
    extreme = np.max([np.abs(_of_order(pairs, orders)).max(0) for pairs in excess.values()], axis=0)
    by = max(in_order, key=lambda k: float(np.abs(in_order[k]).max()))
    forward, backward = (float(v) for v in in_order[by])
    largest = max(abs(forward), abs(backward))
    if largest < MATTERS:
        return None
    # Orders that are as extreme, but for rounding.
    chance = (1.0 + np.count_nonzero(extreme > largest - 1e-9)) / (1.0 + len(orders))
    if chance > ORDER_LEVEL:
        return None
    if abs(backward) > abs(forward):
        return Successive(backward, (-by[0], -by[1]))
    makes_up = forward < 0.0 and not any(by) and _none_alike(correlations[by])
    return Successive(forward, by, makes_up)


def by_pairs(pictures: FloatArray) -> FloatArray:
    """The means of pairs (0 and 1, 2 and 3, ...) that make up for each other, as antithetic ones
    do; the pictures themselves where these are no such pairs.

    Pairs are independent of each other, so that the spread of their means is the error of the
    whole mean, which that of single pictures overstates.  It is so of independent pictures, too:
    that pairs are found by their correlation makes no error, but where it is found by chance.
    Of fewer than FEWEST pairs the means know their spread worse than the pictures know theirs.
    """
    if len(pictures) < 2 * FEWEST or len(pictures) % 2:
        return pictures
    z = deviations(pictures[:MOST])
    links = np.diagonal(_correlations(z, z), 1)
    if not links[::2].max() < links[1::2].min():
        return pictures
    order = successive(pictures)
    if order is None or not order.makes_up:
        return pictures
    return np.asarray(0.5 * (pictures[::2] + pictures[1::2]))


def _none_alike(pairs: FloatArray) -> bool:
    """Whether pictures at no distance in the order are alike: two that take turns with two others
    make up for these, but are of less use than they seem."""
    means = [np.diagonal(pairs, distance).mean() for distance in range(1, len(pairs) // 2 + 1)]
    return bool(max(means) < ALIKE)


def shared_by_sides(a: FloatArray, b: FloatArray) -> bool:
    """Whether replicates of one side share noise with replicates of the other: the squares of their
    correlations are larger than with noise that is moved, by whatever movement. Of unrelated noise
    that is so with a chance of one over the number of pixels."""
    one, two = (_middle(deviations(x).sum(axis=-1)) for x in (a, b))
    size = one.shape[1:]
    first, second = (
        np.fft.rfft2(x / np.sqrt(np.maximum((x**2).sum(axis=(1, 2), keepdims=True), 1e-300)))
        for x in (one, two)
    )
    squares = np.zeros(size)
    for picture, other in itertools.product(first, second):
        squares += np.fft.irfft2(picture.conj() * other, size) ** 2
    return bool(squares[0, 0] > 0.0 and squares.argmax() == 0)


def deviations(pictures: FloatArray) -> FloatArray:
    """From the mean of the replicates, over each value's standard deviation; 0 without noise."""
    deviation = pictures - pictures.mean(axis=0)
    scale = np.sqrt((deviation**2).mean(axis=0))
    noisy = scale > 1e-9 * max(float(np.abs(pictures).max()), 1e-300)
    return np.where(noisy, deviation / np.where(noisy, scale, 1.0), 0.0)


def _middle(pictures: FloatArray) -> FloatArray:
    """At most CROP x CROP pixels of (R, height, width, ...)."""
    top, left = (max(n - CROP, 0) // 2 for n in pictures.shape[1:3])
    return pictures[:, top : top + CROP, left : left + CROP]


def _movement(spectra: npt.NDArray[np.complex128], size: tuple[int, int]) -> tuple[int, int]:
    """To the right and down, not both zero: that of the largest correlation of any two."""
    largest = np.zeros(size)
    for i, j in itertools.combinations(range(len(spectra)), 2):
        np.maximum(
            largest, np.abs(np.fft.irfft2(spectra[i].conj() * spectra[j], size)), out=largest
        )
    largest[0, 0] = -1.0
    y, x = (int(k) for k in np.unravel_index(int(largest.argmax()), size))
    return x - size[1] * (2 * x > size[1]), y - size[0] * (2 * y > size[0])


def _correlations(one: FloatArray, two: FloatArray) -> FloatArray:
    """(R, R): of each picture of `one` with each of `two`."""
    a, b = (x.reshape(len(x), -1) for x in (one, two))
    length = np.sqrt(np.outer((a * a).sum(axis=1), (b * b).sum(axis=1)))
    return np.asarray(a @ b.T / np.maximum(length, 1e-300))


def _about_mean(pairs: FloatArray) -> FloatArray:
    """Minus the mean of all pairs of different pictures."""
    count = len(pairs)
    return np.asarray(pairs - (pairs.sum() - np.trace(pairs)) / (count * (count - 1)))


@functools.cache
def _orders(count: int) -> npt.NDArray[np.int64]:
    """Other orders of so many: of few all, but for their reverses, else random ones."""
    if count == FEWEST:
        every = np.array(list(itertools.permutations(range(count))))
        return every[every[:, 0] < every[:, -1]][1:]
    rows = np.tile(np.arange(count), (ORDERS, 1))
    return np.random.default_rng(0).permuted(rows, axis=1)


def _of_order(pairs: FloatArray, orders: npt.NDArray[np.int64]) -> FloatArray:
    """(2, orders): the mean correlation of successive pictures, forward and backward."""
    first, second = orders[:, :-1], orders[:, 1:]
    return np.stack([pairs[first, second].mean(axis=1), pairs[second, first].mean(axis=1)])
