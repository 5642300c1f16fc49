"""Decimal numbers in the bytes of a text file, for compiled readers."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.jit.kernel import kernel

Bytes = npt.NDArray[np.uint8]

NONE = -1

EXACT = 22
"""Largest power of ten that is a float64; a decimal of at most 2^53 over or times such a power is
rounded once, and so correctly (Clinger 1990, "How to read floating point numbers accurately")."""

POWERS: FloatArray = np.array([float(f"1e{k}") for k in range(EXACT + 1)])


class Decimal(NamedTuple):
    """at: the byte behind it, NONE if it is none;  exact: whether value is it, rounded once."""

    value: float
    at: int
    exact: bool


@kernel
def is_blank(byte: int) -> bool:
    return byte == 32 or byte == 9


@kernel
def ends_word(byte: int) -> bool:
    """Whether it ends a word; a comment, which begins with #, does so too."""
    return is_blank(byte) or byte == 10 or byte == 13 or byte == 35


@kernel
def is_digit(byte: int) -> bool:
    return 48 <= byte <= 57


@kernel
def skip_blanks(data: Bytes, at: int) -> int:
    while is_blank(data[at]):
        at += 1
    return at


@kernel
def decimal(data: Bytes, at: int, powers: FloatArray) -> Decimal:
    """A decimal number that ends at a blank or at the end of a line."""
    negative = data[at] == 45
    if negative or data[at] == 43:
        at += 1
    mantissa, digits, exponent, seen = 0, 0, 0, False
    fraction = False
    while is_digit(data[at]) or (data[at] == 46 and not fraction):
        if data[at] == 46:
            fraction = True
        else:
            seen = True
            if digits > 0 or data[at] != 48:
                digits += 1
            if digits <= 18:
                mantissa = 10 * mantissa + int(data[at]) - 48
                if fraction:
                    exponent -= 1
        at += 1
    if not seen:
        return Decimal(0.0, NONE, False)
    if data[at] == 101 or data[at] == 69:
        at += 1
        below = data[at] == 45
        if below or data[at] == 43:
            at += 1
        if not is_digit(data[at]):
            return Decimal(0.0, NONE, False)
        power = 0
        while is_digit(data[at]):
            power = min(10 * power + int(data[at]) - 48, 100_000)
            at += 1
        exponent += -power if below else power
    if not ends_word(data[at]):
        return Decimal(0.0, NONE, False)
    if digits == 0:
        exponent = 0
    exact = digits <= 18 and mantissa <= 1 << 53 and -EXACT <= exponent <= EXACT
    value = float(mantissa)
    if exact and exponent < 0:
        value /= powers[-exponent]
    elif exact:
        value *= powers[exponent]
    return Decimal(-value if negative else value, at, exact)


__all__ = [
    "NONE",
    "POWERS",
    "Bytes",
    "Decimal",
    "decimal",
    "ends_word",
    "is_blank",
    "is_digit",
    "skip_blanks",
]
