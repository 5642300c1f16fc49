"""Pictures whose squares are no numbers: all of them times one power of two, which changes no
verdict, since biases, limits and margins are fractions."""

import math
from typing import Any

import numpy as np

from comparisons.results.case import FloatArray

FARTHEST = 150
"""Exponent of two: files have values of float32, from 2^-149 to 2^128, whose squares, and those of
these, are normal numbers of float64.  Arrays may have values of which that is not true."""


def exponent_of(*pictures: FloatArray) -> int:
    """Of the largest finite value, to which `times` refers; 0 where squares are numbers."""
    largest = max(float(np.abs(x).max(where=np.isfinite(x), initial=0.0)) for x in pictures)
    exponent = math.frexp(largest)[1]
    return exponent if abs(exponent) > FARTHEST else 0


def times(pictures: Any, exponent: int) -> FloatArray:
    """Pictures times 2^-exponent."""
    return np.asarray(np.ldexp(pictures, -exponent) if exponent else pictures)


def note(exponent: int) -> str:
    """For the reader."""
    return (
        f"all values are multiplied by 2^{-exponent}, since the squares of such "
        f"{'small' if exponent < 0 else 'large'} ones are no numbers"
    )
