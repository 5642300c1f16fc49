"""Reading files of photometry: IESNA LM-63 of 1986, 1991, 1995, 2002 and 2019 (.ies).

A file has labels, a line `TILT=...`, and then numbers alone, which lines may break anywhere: of the
lamps, the factors of all values, how many angles there are, the luminaire's opening, the vertical
and the horizontal angles in degrees, and for each horizontal angle the candelas at all vertical
ones.  This reader takes photometry of type C, whose poles are vertical.
"""

import math
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.util.files import read_input

MOST_BYTES = 1 << 25
"""The most bytes of a file: 32 for each of the most values."""

MOST_VALUES = 1 << 20
"""The most values of a table: a quarter of a degree between directions has 1441 x 721."""

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)

_MOST_DIGITS = 64
"""The most characters of a number: to convert millions of digits takes minutes."""

_HEADINGS = {
    "IESNA91": 1991,
    "IESNA:LM-63-1995": 1995,
    "IESNA:LM-63-2002": 2002,
    "IES:LM-63-2019": 2019,
}
"""The first lines of files that have labels; one of 1986 begins with any words."""

_METRES = {1: 0.3048, 2: 1.0}

_TYPES = {2: "B", 3: "A"}


class Photometry(NamedTuple):
    """Angles in degrees, vertical (m,) and horizontal (k,), and the candelas (k, m) times all
    factors;  opening: the luminaire's width, length and height in metres, negative ones of round
    openings;  tilts: whether the lamp shines differently if it is tilted."""

    vertical: FloatArray
    horizontal: FloatArray
    candelas: FloatArray
    opening: tuple[float, float, float]
    tilts: bool


def read_photometry(path: Path) -> Photometry:
    """The table of an LM-63 file.  Raises ValueError (file, line, what is wrong, what was
    expected)."""
    try:
        content = read_input(path, MOST_BYTES)
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be read: {error.strerror}; expected an LM-63 file (.ies)"
        ) from None
    try:
        return parse(content)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse(content: bytes) -> Photometry:
    """The table of a file's bytes.  Raises ValueError (line, what is wrong, what was expected)."""
    if b"\0" in content:
        raise ValueError("is not text; expected an LM-63 file (.ies)")
    # Labels may hold any characters, numbers are ASCII.  DOS marked the end of a text by 0x1a.
    text = content.decode("latin-1").removeprefix("\xef\xbb\xbf").rstrip("\x1a \t\r\n")
    lines = re.split("\r\n|\n|\r", text)
    year = _year(lines[0].strip())
    start = next((k for k, line in enumerate(lines) if line.lstrip().startswith("TILT=")), None)
    if start is None:
        raise ValueError(
            f"has no line 'TILT=' in {len(lines)} lines; expected an LM-63 file (.ies)"
        )
    numbers = _Numbers(lines, start + 1)
    return _table(numbers, year, _tilts(numbers, lines[start].strip()[5:].strip(), start + 1))


def _year(heading: str) -> int:
    if heading in _HEADINGS:
        return _HEADINGS[heading]
    if heading.upper().startswith(("IESNA", "IES:")):
        known = ", ".join(_HEADINGS)
        raise ValueError(f"line 1: unknown heading {_shown(heading)}; expected one of: {known}")
    return 1986


def _shown(text: str) -> str:
    """A word of a file for a message."""
    return ascii(text if len(text) <= 40 else f"{text[:37]}...")


class _Numbers:
    """The numbers of a file, one after another.  line: of the last one, from 1."""

    def __init__(self, lines: Sequence[str], start: int) -> None:
        self.line = start
        self._words = self._split(lines, start)

    def _split(self, lines: Sequence[str], start: int) -> Iterator[str]:
        for k in range(start, len(lines)):
            self.line = k + 1
            yield from re.findall(r"[^\s,]+", lines[k])

    def wrong(self, message: str) -> ValueError:
        return ValueError(f"line {self.line}: {message}")

    def number(self, what: str, above: float = -math.inf) -> float:
        """The next one.  Raises ValueError, also where it is not above a bound."""
        word = next(self._words, None)
        if word is None:
            raise self.wrong(f"the file ends before {what}; expected a number")
        if len(word) > _MOST_DIGITS or not _NUMBER.fullmatch(word):
            raise self.wrong(f"{what} is {_shown(word)}; expected a number")
        found = float(word)
        if not math.isfinite(found):
            raise self.wrong(f"{what} is {_shown(word)}; expected a finite number")
        if found <= above:
            raise self.wrong(f"{what} is {found:g}; expected more than {above:g}")
        return found

    def count(self, what: str, least: int, most: int = MOST_VALUES) -> int:
        found = self.number(what)
        if found != int(found) or not least <= found <= most:
            raise self.wrong(f"{what} is {found:g}; expected an integer from {least} to {most}")
        return int(found)

    def column(self, n: int, what: str, is_positive: bool = False) -> tuple[list[float], list[int]]:
        """The next n, and their lines."""
        found, lines = [], []
        for k in range(n):
            found.append(self.number(f"{what} {k + 1} of {n}"))
            lines.append(self.line)
            if is_positive and found[-1] < 0.0:
                raise self.wrong(f"{what} {k + 1} of {n} is {found[-1]:g}; expected at least 0")
        return found, lines

    def check_end(self) -> None:
        word = next(self._words, None)
        if word is not None:
            raise self.wrong(f"{_shown(word)} follows the last value; expected the end of the file")


def _tilts(numbers: _Numbers, how: str, line: int) -> bool:
    """Reads what follows `TILT=`: factors of the lamp's flux by its tilt."""
    if how == "NONE":
        return False
    if how != "INCLUDE":
        raise ValueError(
            f"line {line}: TILT={_shown(how)[1:-1]} is not supported; expected TILT=NONE or "
            "TILT=INCLUDE"
        )
    numbers.count("the lamp's place in the luminaire", 1, 3)
    n = numbers.count("the number of tilts", 1)
    numbers.column(n, "tilt")
    factors, _ = numbers.column(n, "factor of tilt", is_positive=True)
    return any(x != 1.0 for x in factors)


def _table(numbers: _Numbers, year: int, tilts: bool) -> Photometry:
    numbers.count("the number of lamps", 0)
    numbers.number("the lumens of a lamp")
    factor = numbers.number("the multiplier", above=0.0)
    m = numbers.count("the number of vertical angles", 2)
    k = numbers.count("the number of horizontal angles", 1)
    if k * m > MOST_VALUES:
        raise numbers.wrong(f"{k} x {m} values; expected at most {MOST_VALUES}")
    kind = numbers.count("the type of photometry", 1, 3)
    if kind in _TYPES:
        raise numbers.wrong(
            f"photometry of type {_TYPES[kind]} ({kind}) is not supported; expected type C (1)"
        )
    metres = _METRES[numbers.count("the unit of lengths", 1, 2)]
    width, length, height = (
        metres * numbers.number(f"the opening's {name}") for name in ("width", "length", "height")
    )
    factor *= numbers.number("the ballast factor", above=0.0)
    # Since 1995 this number is no factor: it was reserved, and in 2019 says how the file was made.
    other = numbers.number("the ballast-lamp photometric factor")
    if year < 1995:
        if other <= 0.0:
            raise numbers.wrong(
                f"the ballast-lamp photometric factor is {other:g}; expected more than 0"
            )
        factor *= other
    numbers.number("the watts")
    vertical, lines_v = numbers.column(m, "vertical angle")
    horizontal, lines_h = numbers.column(k, "horizontal angle")
    for check, angles, lines in (
        (check_vertical, vertical, lines_v),
        (check_horizontal, horizontal, lines_h),
    ):
        try:
            check(angles)
        except WrongAngleError as error:
            raise ValueError(f"line {lines[error.index]}: {error}") from None
    values, _ = numbers.column(k * m, "value", is_positive=True)
    numbers.check_end()
    with np.errstate(over="ignore"):
        candelas = factor * np.array(values).reshape(k, m)
    if not np.isfinite(candelas).all():
        raise ValueError("the values times their factors overflow; expected smaller ones")
    opening = width, length, height
    return Photometry(np.array(vertical), np.array(horizontal), candelas, opening, tilts)


class WrongAngleError(ValueError):
    """index: of the angle."""

    def __init__(self, index: int, message: str) -> None:
        super().__init__(message)
        self.index = index


def _check_order(angles: Sequence[float], name: str) -> None:
    for j, (one, other) in enumerate(pairwise(angles)):
        if not one < other:
            raise WrongAngleError(
                j + 1, f"{name} angle {other:g} follows {one:g}; expected ascending angles"
            )


def check_vertical(angles: Sequence[float]) -> None:
    """Raises WrongAngleError for vertical angles, in degrees, of no table of type C."""
    if len(angles) < 2:
        raise WrongAngleError(0, f"{len(angles)} vertical angles; expected two or more")
    _check_order(angles, "vertical")
    for j in (0, len(angles) - 1):
        if not 0.0 <= angles[j] <= 180.0:
            raise WrongAngleError(
                j, f"vertical angle {angles[j]:g}; expected angles from 0 to 180 degrees"
            )


def check_horizontal(angles: Sequence[float]) -> None:
    """Raises WrongAngleError for horizontal angles, in degrees, of no table of type C."""
    if not len(angles):
        raise WrongAngleError(0, "no horizontal angle; expected one or more")
    _check_order(angles, "horizontal")
    first, last = angles[0], angles[-1]
    if (first, last) not in ((0.0, 0.0), (0.0, 90.0), (0.0, 180.0), (0.0, 360.0), (90.0, 270.0)):
        raise WrongAngleError(
            len(angles) - 1,
            f"horizontal angles from {first:g} to {last:g}; expected 0 alone, 0 to 90, 0 to 180, "
            "0 to 360, or 90 to 270 degrees",
        )
