"""What every kind of image file is read as: a size, told before the pixels, and strips of rows."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray

Curve = Callable[[FloatArray], FloatArray]
"""From encoded values to linear ones, number by number."""

_STRIP = 1 << 14
"""Pixels that are converted at once: few enough that what is made on the way counts for little."""


class Strip(NamedTuple):
    """Some whole rows of an image.

    rows: which, counted from the top;  colours: (rows, width, 3);  opacity: (rows, width) from 0 to
    1, None where the file has none or it was not asked for.
    """

    rows: slice
    colours: FloatArray
    opacity: FloatArray | None


@dataclass(frozen=True)
class ImageFile:
    """An image whose header has been read.

    is_integer: whether its numbers are codes of a display's curve, from 0 to 1, rather than linear
    floats;  bits: of a number in the file;  has_opacity: as the header has it;  text: found in the
    header, by name.
    """

    path: Path
    width: int
    height: int
    is_integer: bool = False
    bits: int = 32
    has_opacity: bool = False
    text: dict[str, str] = field(default_factory=dict)

    def strips(self, curve: Curve | None = None, with_opacity: bool = False) -> Iterator[Strip]:
        """All rows, in any order; `curve` is applied to colours.  Raises ValueError, OSError.

        Besides the strips this keeps at most 8 bytes a pixel in memory: as much as readers of
        textures, which store 24, may have (but OpenEXR decodes all channels of a file at once).
        """
        raise NotImplementedError

    def row_ranges(self) -> Iterator[slice]:
        """The rows of each strip, from the top."""
        step = max(1, _STRIP // max(self.width, 1))
        for start in range(0, self.height, step):
            yield slice(start, min(start + step, self.height))


def in_colour(values: npt.NDArray[Any], curve: Curve | None) -> FloatArray:
    """(rows, width, 3) float64 of floats (rows, width), which are grey, or (rows, width, 3)."""
    found = as_float64(values)
    found = found if curve is None else curve(found)
    return np.repeat(found[..., None], 3, axis=-1) if found.ndim == 2 else found


def as_float64(values: npt.NDArray[Any]) -> FloatArray:
    """A copy; signalling NaNs, which the processor reports, become quiet ones."""
    with np.errstate(invalid="ignore"):
        return np.array(values, dtype=np.float64)


def decoding(bits: int, curve: Curve | None) -> FloatArray:
    """(2^bits,): the value of every code, which is a table since there are fewer codes than
    pixels."""
    most = (1 << bits) - 1
    values = np.arange(most + 1) / float(most)
    return values if curve is None else curve(values)


def check_length(found: int, expected: int) -> None:
    """Raise ValueError where a file has not exactly as many bytes of pixels as its header says."""
    if found < expected:
        raise ValueError(f"is truncated: {found} bytes of pixels; expected {expected}")
    if found > expected:
        raise ValueError(f"has {found} bytes of pixels; expected {expected}")
