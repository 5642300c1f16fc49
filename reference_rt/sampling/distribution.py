"""Sampling of tabulated densities by inversion: running sums (unnormalised CDFs) and bisection,
with guide tables where a table is large."""

from typing import Any

import numpy as np

from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import TINY, larger, smaller, square_root


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


def guide(sums: FloatArray) -> IdArray:
    """Where `guided_cell_of` begins to search in each row of running sums (m, n + 1): (m, n + 1)
    cells, at equal steps of the row's total (Chen and Asau 1974, the method of guide tables)."""
    steps, last = sums.shape[1] - 1, sums.shape[1] - 2
    found = np.empty((len(sums), steps + 1), np.int32)
    for row, cells in zip(sums, found, strict=True):
        after = np.searchsorted(row, np.linspace(0.0, row[-1], steps + 1), side="right")
        cells[:] = np.minimum(after - 1, last)
    return found


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
def linear(u: Any, a: Any, b: Any) -> Any:
    """A number in [0, 1] with a density that is linear from a >= 0 at 0 to b >= 0 at 1, for u from
    0 to 1; a generic function (`jit.simd`).

    Solves a t + (b - a) t² / 2 = u (a + b) / 2 for t, in the form without cancellation; a and b are
    divided by the larger one, so that no square overflows.
    """
    most = larger(larger(a, b), TINY)
    a, b = a / most, b / most
    root = square_root((1.0 - u) * a * a + u * b * b)
    return smaller(u * (a + b) / larger(a + root, TINY), 1.0)
