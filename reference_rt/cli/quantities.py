"""Quantities of the command line, read and in words: sizes, durations, numbers of bytes, shares."""

import math
import re

from reference_rt.util.errors import UsageError

_SECONDS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
_BYTES = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)\s*([a-zA-Z%]*)", re.ASCII)
_MOST_DIGITS = 30


def size_of(text: str) -> tuple[int, int]:
    """Width and height in pixels, as in 640x480.  Raises UsageError that names --size."""
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(n.isdecimal() and len(n) < 11 for n in sides):
        raise UsageError(f"--size: expected WIDTHxHEIGHT, such as 640x480, got '{text}'")
    width, height = map(int, sides)
    if min(width, height) < 1:
        raise UsageError(f"--size: expected greater than or equal to 1, got '{text}'")
    return width, height


def seconds_in(text: str) -> float:
    """A duration, as in 90s, 10m, 1.5h, 2d; 90 alone is seconds.  Raises ValueError."""
    number, unit = _split(text)
    if math.isnan(number) or unit.lower() not in _SECONDS or number <= 0.0:
        raise ValueError(f"expected a duration, such as 90s, 10m or 1.5h, got '{text}'")
    return number * _SECONDS[unit.lower()]


def seconds_of(text: str, option: str) -> float:
    """The same of an option.  Raises UsageError that names it."""
    try:
        return seconds_in(text)
    except ValueError as error:
        raise UsageError(f"{option}: {error}") from None


def bytes_of(text: str, option: str) -> int:
    """A number of bytes, as in 500M or 2G.  Raises UsageError that names the option."""
    number, unit = _split(text)
    unit = unit.upper().removesuffix("B").removesuffix("I")
    if math.isnan(number) or unit not in _BYTES or number <= 0.0:
        raise UsageError(
            f"{option}: expected an amount of memory, such as 500M or 2G, got '{text}'"
        )
    return round(number * _BYTES[unit])


def share_of(text: str, option: str) -> float:
    """A share, as in 1% or 0.01.  Raises UsageError that names the option."""
    number, unit = _split(text)
    share = number / 100.0 if unit == "%" else number
    if math.isnan(number) or unit not in ("", "%") or not 0.0 < share < 1.0:
        raise UsageError(f"{option}: expected a share, such as 1% or 0.01, got '{text}'")
    return share


def duration(seconds: float) -> str:
    """A duration in words: 4.2 s, 3:07, 2:03:07."""
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    hours, minutes = whole // 3600, whole // 60 % 60
    if hours == 0:
        return f"{minutes}:{whole % 60:02}"
    return f"{hours}:{minutes:02}:{whole % 60:02}"


def percentage(share: float) -> str:
    """A share in words, with two significant digits: 3.1 %."""
    return f"{100.0 * share:.2g} %"


def _split(text: str) -> tuple[float, str]:
    """The number and the unit; nan where there is no number."""
    found = _NUMBER.fullmatch(text.strip()) if len(text) <= _MOST_DIGITS else None
    return (float(found[1]), found[2]) if found else (math.nan, "")
