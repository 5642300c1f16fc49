"""Units of work: a range of samples of a run of pixels.

A picture has passes: first so many samples of every pixel, then some more, and so on.  A unit adds
the samples of one pass to the sums of some pixels.  It depends on nothing but these sums, so that
any thread, process or machine may compute it, twice if one dies, and the result has the same bits.
Since samples are added one after another, no bit depends on how a picture is divided into units.

Pixels are counted along rows.  Samples are counted for chunks of pixels (`chunk_of`), which units
never divide."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import IntArray

BAND = 1 << 17
"""Pixels that are stored together: 3 MB of colour, which take more than a second to compute."""

_MOST_SAMPLES = 1 << 21
"""Samples of a pass in one chunk: a second or two of work."""

_FEWEST_PASSES = 1024
"""Chunks that a picture has, unless these would be smaller than _SMALLEST: so many units of a pass
can be computed at the same time."""

_SMALLEST, _LARGEST = 64, 2048
"""Pixels of a chunk."""

_FIRST = 16
"""Samples of the first passes: as many as the Sobol' sampler computes together."""


class Unit(NamedTuple):
    """Samples first to last - 1 of pixels begin to end - 1."""

    begin: int
    end: int
    first: int
    last: int

    @property
    def samples(self) -> int:
        """The number of samples of all its pixels."""
        return (self.end - self.begin) * (self.last - self.first)


def chunk_of(pixels: int) -> int:
    """Pixels of a chunk of a picture: a power of two, which divides BAND."""
    chunk = _SMALLEST
    while chunk < _LARGEST and chunk * _FEWEST_PASSES < pixels:
        chunk *= 2
    return chunk


def passes(spp: int, chunk: int, least: int = _FIRST) -> Iterator[int]:
    """Samples per pixel after each pass, up to spp.

    A pass adds a quarter of the samples so far: pixels that a limit stops within a pass have nearly
    the same noise, and there are few passes.  It adds at least `least`.  All end at a multiple of
    16 samples, except the last.
    """
    done = 0
    least = max(_FIRST, -(-least // _FIRST) * _FIRST)
    most = max(_FIRST, _MOST_SAMPLES // chunk)
    while done < spp:
        done = min(spp, done + min(most, max(least, done // 4 // _FIRST * _FIRST)))
        yield done


def plan(done: IntArray, pixels: int, spp: int, size: int, least: int = _FIRST) -> Iterator[Unit]:
    """The units that are left of a picture, pass by pass, along the pixels.

    done: samples of each chunk so far;  size: samples of a unit, as far as passes and chunks allow;
    least: see `passes`.
    """
    chunk = chunk_of(pixels)
    planned = done.copy()
    for end in passes(spp, chunk, least):
        yield from _pass(planned, pixels, end, size, chunk)


def _pass(planned: IntArray, pixels: int, last: int, size: int, chunk: int) -> Iterator[Unit]:
    """The units after which all chunks have `last` samples; changes `planned` so."""
    k = 0
    while k < len(planned):
        first = int(planned[k])
        if first >= last:
            k += 1
            continue
        # As many chunks as make up a unit, of one band and with the same samples so far.
        most = max(1, size // (chunk * (last - first)))
        stop = min(k + most, len(planned), (k * chunk // BAND + 1) * BAND // chunk)
        others = np.flatnonzero(planned[k:stop] != first)
        stop = stop if len(others) == 0 else k + int(others[0])
        planned[k:stop] = last
        yield Unit(k * chunk, min(stop * chunk, pixels), first, last)
        k = stop


SAMPLES_PER_TILE = 1 << 15
"""Samples of one kernel call, about 20 ms: short enough for progress and Ctrl-C, long against the
0.1 ms that a task of the thread pool costs."""


def tiles_of(unit: Unit) -> Iterator[Unit]:
    """The kernel calls of a unit, in order."""
    step = max(1, SAMPLES_PER_TILE // (unit.last - unit.first))
    for begin in range(unit.begin, unit.end, step):
        end = min(begin + step, unit.end)
        for first in range(unit.first, unit.last, SAMPLES_PER_TILE):
            yield Unit(begin, end, first, min(first + SAMPLES_PER_TILE, unit.last))
