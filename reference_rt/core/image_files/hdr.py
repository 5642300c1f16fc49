"""Radiance RGBE images, .hdr and .pic (Ward 1991, "Real pixels"): three mantissas, one exponent."""

import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.core.image_files.image_file import ImageFile, StoredStrip, check_length
from reference_rt.util.files import open_input

_HEADER = 4096
"""The most bytes of a header: its end is searched for in these alone."""

_SIZE = re.compile(rb"([-+])Y (\d{1,9}) ([-+])X (\d{1,9})\n")


@dataclass(frozen=True)
class HdrFile(ImageFile):
    """Values are radiance: EXPOSURE and COLORCORR of the header are undone.

    A mantissa m is decoded as the middle of its interval, m + 1/2, as in Radiance itself, whose
    writers round down; 0 is 0.  start: byte offset of the pixels;  exposure: (3,), the factors by
    which the values were multiplied before they were written;  flips: whether rows run upwards, and
    whether pixels run leftwards.
    """

    start: int = 0
    exposure: tuple[float, ...] = (1.0, 1.0, 1.0)
    flips: tuple[bool, bool] = (False, False)

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        with open_input(self.path) as file:
            file.seek(self.start)
            data = file.read()
        is_run_length = data[:2] == b"\x02\x02" and 8 <= self.width < 1 << 15
        if not is_run_length:
            check_length(len(data), self.width * self.height * 4)
        at = 0
        for rows in self.row_ranges():
            count = rows.stop - rows.start
            if is_run_length:
                rgbe, at = _runs(data, at, self.width, rows.start, count)
            else:
                size = (count, self.width, 4)
                rgbe = np.frombuffer(data, np.uint8, math.prod(size), at).reshape(size)
                at += math.prod(size)
                if self.width > 1 and (rgbe[..., :3] == 1).all(axis=-1).any():
                    raise ValueError("has runs of the old kind; expected those since 1991, or none")
            values = (_radiance(rgbe) / np.array(self.exposure)).astype(self.kind)
            upwards, leftwards = self.flips
            if upwards:
                rows = slice(self.height - rows.stop, self.height - rows.start)
            turned = values[:: -1 if upwards else 1, :: -1 if leftwards else 1]
            yield StoredStrip(rows, turned, None)
        if at != len(data):
            raise ValueError(f"has {len(data) - at} bytes too many; expected {self.height} rows")


def open_hdr(path: Path) -> ImageFile:
    """Raises ValueError (what is wrong, what was expected)."""
    with open_input(path) as file:
        head = file.read(_HEADER)
        size = os.fstat(file.fileno()).st_size
    end = head.find(b"\n\n")
    match = _SIZE.match(head[end + 2 :])
    if end < 0 or match is None:
        raise ValueError("has a malformed HDR header; expected its lines and -Y height +X width")
    exposure = _exposure(head[:end].decode("latin-1").splitlines())
    height, width = int(match[2]), int(match[4])
    start = end + 2 + match.end()
    # The shortest scanline: a mark, and of each channel runs of 127.
    least = height * (4 + 8 * math.ceil(width / 127)) if 8 <= width < 1 << 15 else 0
    if size - start < least:
        raise ValueError("is truncated: too short for its size; expected whole scanlines")
    flips = match[1] == b"+", match[3] == b"-"
    # (m + 1/2) 2^e has nine bits, and its least exponent is a denormal float32's: it is exact.
    kind = "float32" if exposure == (1.0, 1.0, 1.0) else "float64"
    return HdrFile(path, width, height, kind, bits=8, start=start, exposure=exposure, flips=flips)


def _radiance(rgbe: npt.NDArray[np.uint8]) -> FloatArray:
    """(rows, width, 3) radiance from mantissas and exponents (rows, width, 4)."""
    mantissa = rgbe[..., :3].astype(np.float64)
    mantissa[mantissa > 0.0] += 0.5
    power = np.ldexp(1.0, rgbe[..., 3:].astype(np.int64) - 136)
    return np.where(rgbe[..., 3:] > 0, mantissa * power, 0.0)


def _exposure(lines: list[str]) -> tuple[float, ...]:
    """The factors by which the three channels were multiplied before they were written."""
    found = np.ones(3)
    kind = ""
    for line in lines:
        key, _, value = line.partition("=")
        if key == "FORMAT":
            kind = value.strip()
        elif key in ("EXPOSURE", "COLORCORR"):
            try:
                factors = np.array([float(word) for word in value.split()])
            except ValueError:
                factors = np.zeros(1)
            if len(factors) not in (1, 3) or not (np.isfinite(factors) & (factors > 0.0)).all():
                raise ValueError(f"has the header line '{line[:60]}'; expected positive numbers")
            found = found * factors
    if kind != "32-bit_rle_rgbe":
        raise ValueError(f"has the format '{kind[:40]}'; expected 32-bit_rle_rgbe")
    return tuple(found.tolist())


def _runs(
    data: bytes, at: int, width: int, first: int, count: int
) -> tuple[npt.NDArray[np.uint8], int]:
    """Decodes `count` scanlines, run-length encoded channel by channel: (count, width, 4), and the
    offset of the next one.  `first`: the first one's row number, for errors."""
    out = bytearray()
    mark = b"\x02\x02" + width.to_bytes(2, "big")
    for y in range(first, first + count):
        if data[at : at + 4] != mark:
            what = "is truncated" if at + 4 > len(data) else "is malformed"
            raise ValueError(f"{what} at row {y}; expected a scanline of {width} pixels")
        at += 4
        for _ in range(4):
            left = width
            while left > 0:
                if at + 1 >= len(data):
                    raise ValueError(f"is truncated at row {y}; expected whole scanlines")
                length = data[at]
                is_run = length > 128
                length -= 128 if is_run else 0
                end = at + 2 if is_run else at + 1 + length
                if length == 0 or length > left or end > len(data):
                    what = "is truncated" if end > len(data) else "is malformed"
                    raise ValueError(f"{what} at row {y}; expected runs of {width} pixels in all")
                out += data[at + 1 : end] * length if is_run else data[at + 1 : end]
                left, at = left - length, end
    rows = np.frombuffer(out, np.uint8).reshape(count, 4, width)
    return rows.transpose(0, 2, 1), at
