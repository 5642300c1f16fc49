"""Sampling of tabulated densities by inversion: running sums (unnormalised CDFs) and bisection,
with guide tables where a table is large."""

import math

import numpy as np

from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.jit.kernel import kernel


def running_sums(values: FloatArray) -> FloatArray:
    """(..., n + 1): 0 and the sums of the first 1 to n of values (..., n)."""
    start = np.zeros((*values.shape[:-1], 1))
    return np.concatenate([start, np.cumsum(values, axis=-1)], axis=-1)


@kernel
def count_up_to(sums: FloatArray, x: float) -> int:
    """How many of the ascending sums (n,) are at most x: `np.searchsorted(sums, x, "right")`, for
    which Numba would compile six functions."""
    low, high = 0, len(sums)
    while low < high:
        middle = (low + high) >> 1
        if sums[middle] <= x:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def cell_of(sums: FloatArray, x: float) -> int:
    """The cell i with sums[i] <= x < sums[i + 1] of running sums (n + 1,); never one of width 0."""
    return min(max(count_up_to(sums, x) - 1, 0), len(sums) - 2)


@kernel
def blended(sums: FloatArray, k: int, s: float, i: int) -> float:
    """Entry i of the running sums interpolated between rows k (s = 0) and k + 1 (s = 1)."""
    return float(sums[k, i] * (1.0 - s) + sums[k + 1, i] * s)


def guide(sums: FloatArray) -> IdArray:
    """Where to begin a search in running sums (m, n + 1), as `bracket` reads it: (m, n // 4 + 2)
    cells, at equal steps of each row's total (Chen and Asau 1974, the method of guide tables)."""
    steps, last = sums.shape[1] // 4 + 1, sums.shape[1] - 2
    found = np.empty((len(sums), steps + 1), np.int32)
    for row, cells in zip(sums, found, strict=True):
        after = np.searchsorted(row, np.linspace(0.0, row[-1], steps + 1), side="right")
        cells[:] = np.minimum(after - 1, last)
    return found


@kernel
def bracket(guides: IdArray, k: int, u: float) -> tuple[int, int]:
    """The first cell that holds the share u of row k or of row k + 1, or any of their means, and
    the one after the last, but for rounding."""
    steps = guides.shape[1] - 1
    j = min(int(u * steps), steps - 1)
    low = min(guides[k, j], guides[k + 1, j])
    high = max(guides[k, j + 1], guides[k + 1, j + 1])
    return int(low), int(high) + 1


@kernel
def guided_cell_of(sums: FloatArray, guides: IdArray, u: float) -> int:
    """As `cell_of`, for the share u of the last of running sums (n + 1,) that have `guides`."""
    steps, x = len(guides) - 1, u * sums[-1]
    j = min(int(u * steps), steps - 1)
    i = int(guides[j])
    while i < len(sums) - 2 and sums[i + 1] <= x:
        i += 1
    while sums[i] > x:  # by rounding alone
        i -= 1
    return i


@kernel
def blended_cell_of(sums: FloatArray, k: int, s: float, x: float, low: int, high: int) -> int:
    """As `cell_of`, for the `blended` rows of sums (m, n + 1), where the cell is expected from low
    to high - 1: by bisection there, and everywhere if it is not."""
    end = sums.shape[1] - 1
    if blended(sums, k, s, low) > x:
        low = 0
    if blended(sums, k, s, high) <= x:
        high = end
    while high - low > 1:
        middle = (low + high) // 2
        if blended(sums, k, s, middle) <= x:
            low = middle
        else:
            high = middle
    return low


@kernel
def linear(u: float, a: float, b: float) -> float:
    """A number in [0, 1] with a density that is linear from a >= 0 at 0 to b >= 0 at 1.

    Solves a t + (b - a) t² / 2 = u (a + b) / 2 for t, in the form without cancellation; a and b are
    divided by the larger one, so that no square overflows.
    """
    most = max(a, b)
    if u <= 0.0 or most == 0.0:
        return 0.0
    a, b = a / most, b / most
    return min(u * (a + b) / (a + math.sqrt((1.0 - u) * a * a + u * b * b)), 1.0)
