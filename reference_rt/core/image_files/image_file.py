"""`ImageFile`, the interface of all image formats: size and properties, then strips of rows."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray

Curve = Callable[[FloatArray], FloatArray]
"""A transfer function: encoded values to linear ones, elementwise."""

_STRIP = 1 << 14
"""Pixels converted at once: few enough that intermediate arrays take little memory."""


class Strip(NamedTuple):
    """Some whole rows of an image.

    rows: counted from the top;  colours: (rows, width, 3);  opacity: (rows, width) from 0 to 1,
    None where the file has none or it was not requested.
    """

    rows: slice
    colours: FloatArray
    opacity: FloatArray | None


@dataclass(frozen=True)
class ImageFile:
    """An image whose header has been read.

    is_integer: whether values are integer codes of a display's transfer function, scaled to 0 to 1,
    rather than linear floats;  bits: per channel in the file;  has_opacity: according to the
    header;  text: the header's text entries, by name.
    """

    path: Path
    width: int
    height: int
    is_integer: bool = False
    bits: int = 32
    has_opacity: bool = False
    text: dict[str, str] = field(default_factory=dict)

    def strips(self, curve: Curve | None = None, with_opacity: bool = False) -> Iterator[Strip]:
        """All rows, in any order of strips; `curve` is applied to colours.  Raises ValueError,
        OSError.

        Besides the strips this takes at most 8 bytes of memory per pixel, the allowance in
        `textures.image_file` beside the 24 of a texel (except that OpenEXR decodes all channels of
        a file at once).
        """
        raise NotImplementedError

    def row_ranges(self) -> Iterator[slice]:
        """The range of rows of each strip, from the top."""
        step = max(1, _STRIP // max(self.width, 1))
        for start in range(0, self.height, step):
            yield slice(start, min(start + step, self.height))


def in_colour(values: npt.NDArray[Any], curve: Curve | None) -> FloatArray:
    """(rows, width, 3) float64 from floats (rows, width, 3), or grey (rows, width)."""
    found = as_float64(values)
    found = found if curve is None else curve(found)
    return np.repeat(found[..., None], 3, axis=-1) if found.ndim == 2 else found


def as_float64(values: npt.NDArray[Any]) -> FloatArray:
    """A copy as float64; signalling NaNs, which would raise a warning, become quiet ones."""
    with np.errstate(invalid="ignore"):
        return np.array(values, dtype=np.float64)


def decoding(bits: int, curve: Curve | None) -> FloatArray:
    """(2^bits,): the decoded value of every integer code, as a lookup table."""
    most = (1 << bits) - 1
    values = np.arange(most + 1) / float(most)
    return values if curve is None else curve(values)


def check_length(found: int, expected: int) -> None:
    """Raises ValueError if the number of bytes of pixels is not what the header implies."""
    if found < expected:
        raise ValueError(f"is truncated: {found} bytes of pixels; expected {expected}")
    if found > expected:
        raise ValueError(f"has {found} bytes of pixels; expected {expected}")
