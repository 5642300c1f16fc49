"""Portable Float Maps, .pfm: float32, grey or colour, of either byte order."""

import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reference_rt.core.image_files.image_file import ImageFile, StoredStrip, check_length
from reference_rt.util.files import open_input

_HEADER = 4096
"""The most bytes of a header: its end is searched for in these alone."""

_PATTERN = re.compile(rb"P([Ff])\s+(\d{1,9})\s+(\d{1,9})\s+([-+.\deE]{1,32})\s")


@dataclass(frozen=True)
class PfmFile(ImageFile):
    """start: byte offset of the pixels;  order: NumPy's type of a number with its byte order."""

    start: int = 0
    order: str = "<f4"

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        channels = 1 if self.is_grey else 3
        row = self.width * channels
        with open_input(self.path) as file:
            for rows in self.row_ranges():
                # The file stores rows from the bottom up.
                file.seek(self.start + 4 * row * (self.height - rows.stop))
                values = np.fromfile(file, self.order, row * (rows.stop - rows.start))
                upwards = values.reshape(rows.stop - rows.start, self.width, channels)
                yield StoredStrip(rows, upwards[::-1], None)


def open_pfm(path: Path) -> ImageFile:
    """Raises ValueError (what is wrong, what was expected)."""
    with open_input(path) as file:
        match = _PATTERN.match(file.read(_HEADER))
        size = os.fstat(file.fileno()).st_size
    if match is None:
        raise ValueError("has a malformed PFM header; expected PF, width, height and scale")
    channels = 3 if match[1] == b"F" else 1
    width, height = int(match[2]), int(match[3])
    try:
        scale = float(match[4])
    except ValueError:
        scale = math.nan
    if abs(scale) != 1.0:
        raise ValueError(
            f"has the scale {match[4].decode()}, which readers do not agree upon; expected 1 "
            "(big-endian) or -1 (little-endian)"
        )
    if min(width, height) > 0:  # `open_image` refuses images without pixels
        check_length(size - match.end(), width * height * channels * 4)
    order = "<f4" if scale < 0.0 else ">f4"
    return PfmFile(path, width, height, is_grey=channels == 1, start=match.end(), order=order)
