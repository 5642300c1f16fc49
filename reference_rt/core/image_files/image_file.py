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


HEADER = 4096
"""The most bytes of a header that is searched for its end."""


class Beginning(NamedTuple):
    """A file: its first bytes, with all of the header that formats without a library have; its
    size in bytes."""

    path: Path
    head: bytes
    size: int


class StoredStrip(NamedTuple):
    """Some whole rows of an image as its file stores them.

    rows: counted from the top;  values: (rows, width, 1) of grey images, else (rows, width, 3);
    opacity: (rows, width), None where the file has none or it was not requested.  Integer codes of
    8 or 16 bits, or floats.
    """

    rows: slice
    values: npt.NDArray[Any]
    opacity: npt.NDArray[Any] | None


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

    kind: NumPy's type that can hold the stored values: uint8 or uint16 for integer codes of a
    display's transfer function, where the largest means 1, else float16, float32 or float64 for
    linear values, of which strips may have a narrower one;  is_grey: whether there is one value per
    pixel;  bits: per channel in the file;  has_opacity: according to the header;  text: the
    header's text entries, by name;  note: what of the file is read, where that is not all.
    """

    path: Path
    width: int
    height: int
    kind: str = "float32"
    is_grey: bool = False
    bits: int = 32
    has_opacity: bool = False
    text: dict[str, str] = field(default_factory=dict)
    note: str = ""

    @property
    def is_integer(self) -> bool:
        return self.kind in ("uint8", "uint16")

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        """All rows, in any order of strips.  Raises ValueError, OSError.

        Besides the strips this takes at most 8 bytes of memory per pixel, the allowance in
        `textures.image_file` beside those of a texel (except that OpenEXR decodes all channels of
        a file at once).
        """
        raise NotImplementedError

    def strips(self, curve: Curve | None = None, with_opacity: bool = False) -> Iterator[Strip]:
        """The same as colours; `curve` is applied to them."""
        table = decoding(self.kind, curve) if self.is_integer else None
        for rows, values, opacity in self.stored(with_opacity):
            if table is not None:
                colours = table[values]
            else:
                colours = as_float64(values)
                colours = colours if curve is None else curve(colours)
            if self.is_grey:
                colours = np.repeat(colours, 3, axis=-1)
            if opacity is not None:
                opacity = as_float64(opacity)
                opacity = opacity / np.iinfo(self.kind).max if self.is_integer else opacity
            yield Strip(rows, colours, opacity)

    def row_ranges(self) -> Iterator[slice]:
        """The range of rows of each strip, from the top."""
        step = max(1, _STRIP // max(self.width, 1))
        for start in range(0, self.height, step):
            yield slice(start, min(start + step, self.height))


def as_float64(values: npt.NDArray[Any]) -> FloatArray:
    """A copy as float64, without a warning: signalling NaNs become quiet ones, and long doubles
    beyond its range infinite."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.array(values, dtype=np.float64)


def decoding(kind: str, curve: Curve | None) -> FloatArray:
    """(2^bits,): the linear value of every code of 8 or 16 bits, or of every half float by its
    bits."""
    if kind == "float16":
        values = as_float64(np.arange(1 << 16, dtype=np.uint16).view(np.float16))
    else:
        most = int(np.iinfo(kind).max)
        values = np.arange(most + 1) / float(most)
    return values if curve is None else curve(values)


def check_length(found: int, expected: int) -> None:
    """Raises ValueError if the number of bytes of pixels is not what the header implies."""
    if found < expected:
        raise ValueError(f"is truncated: {found} bytes of pixels; expected {expected}")
    if found > expected:
        raise ValueError(f"has {found} bytes of pixels; expected {expected}")
