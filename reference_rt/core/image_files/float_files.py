"""Formats of linear radiance, decoded here: Radiance RGBE, .hdr and .pic (Ward 1991, "Real pixels":
three mantissas, one exponent); Portable Float Maps, .pfm (float32, grey or colour, of either byte
order); NumPy arrays of floats, .npy.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.core.image_files.image_file import (
    HEADER,
    Beginning,
    ImageFile,
    StoredStrip,
    as_float64,
    check_length,
)
from reference_rt.util.files import open_input

Rgbe = npt.NDArray[np.uint8]

_SIZE = re.compile(rb"([-+])([XY]) (\d{1,9}) ([-+])([XY]) (\d{1,9})\n")


@dataclass(frozen=True)
class HdrFile(ImageFile):
    """A mantissa m with exponent e means m 2^(e - 136), and EXPOSURE and COLORCORR of the header
    are ignored, as by Mitsuba, stb_image and OpenCV: what other renderers show of the file.

    middle: m means (m + 1/2) 2^(e - 136) in its place, the middle of what Radiance's writers, which
    round down, may have had; 0 is 0.  exposure: (3,), factors by which the values were multiplied
    before they were written, and are divided.  start: byte offset of the pixels;  scanlines: their
    number and length, in order: columns if `columns`, else rows;  flips: whether rows run upwards,
    and whether pixels run leftwards.
    """

    middle: bool = False
    exposure: tuple[float, ...] = (1.0, 1.0, 1.0)
    start: int = 0
    scanlines: tuple[int, int] = (0, 0)
    columns: bool = False
    flips: tuple[bool, bool] = (False, False)

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        with open_input(self.path) as file:
            file.seek(self.start)
            data = file.read()
        count, length = self.scanlines
        if _is_new(data[:2], length):
            rgbe = _runs(data, count, length)
        else:
            rgbe = _old_runs(data, count * length).reshape(count, length, 4)
        if self.columns:
            rgbe = rgbe.transpose(1, 0, 2)
        upwards, leftwards = self.flips
        rgbe = rgbe[:: -1 if upwards else 1, :: -1 if leftwards else 1]
        for rows in self.row_ranges():
            values = _radiance(rgbe[rows], 0.5 if self.middle else 0.0)
            yield StoredStrip(rows, (values / np.array(self.exposure)).astype(self.kind), None)


def open_hdr(file: Beginning, radiance: bool = False) -> ImageFile:
    """radiance: decode as Radiance itself does, see `HdrFile`.  Raises ValueError (what is wrong,
    what was expected)."""
    head = file.head
    end = head.find(b"\n\n", 0, HEADER)
    match = _SIZE.match(head[end + 2 :])
    if end < 0 or match is None or match[2] == match[5]:
        raise ValueError("has a malformed HDR header; expected its lines and -Y height +X width")
    exposure = _exposure(head[:end].decode("latin-1").splitlines())
    count, length = int(match[3]), int(match[6])
    start = end + 2 + match.end()
    if _is_new(head[start : start + 2], length):
        # The shortest scanline: a mark, and of each channel runs of 127.
        if file.size - start < count * (4 + 8 * math.ceil(length / 127)):
            raise ValueError("is truncated: too short for its size; expected whole scanlines")
    columns = match[2] == b"X"
    sign = {match[2]: match[1], match[5]: match[4]}
    return HdrFile(
        file.path,
        count if columns else length,
        length if columns else count,
        # m + 1/2 has nine bits, and the least exponent is a denormal float32's: it is exact.
        "float32" if not radiance or exposure == (1.0, 1.0, 1.0) else "float64",
        bits=8,
        middle=radiance,
        exposure=exposure if radiance else (1.0, 1.0, 1.0),
        start=start,
        scanlines=(count, length),
        columns=columns,
        flips=(sign[b"Y"] == b"+", sign[b"X"] == b"-"),
    )


def _is_new(start: bytes, length: int) -> bool:
    """Whether scanlines are run-length encoded channel by channel, as since 1991."""
    return start == b"\x02\x02" and 8 <= length < 1 << 15


def _radiance(rgbe: Rgbe, middle: float) -> FloatArray:
    """(rows, width, 3) radiance from mantissas and exponents (rows, width, 4)."""
    mantissa = rgbe[..., :3].astype(np.float64)
    mantissa[mantissa > 0.0] += middle
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


def _old_runs(data: bytes, count: int) -> Rgbe:
    """(count, 4) pixels as before 1991.  A pixel with the mantissas 1, 1, 1 repeats the one before
    it as often as its exponent says; of several in a row each next one counts 256 times as much."""
    if len(data) % 4:
        check_length(len(data), 4 * count)
    pixels = np.frombuffer(data, np.uint8).reshape(-1, 4)
    is_run = pixels[:, 0] == 1
    for channel in (1, 2):  # one at a time takes half of the memory of all at once
        is_run &= pixels[:, channel] == 1
    if not is_run.any():
        check_length(len(data), 4 * count)
        return pixels
    place = np.arange(len(pixels))
    source = np.maximum.accumulate(np.where(is_run, -1, place))  # the last pixel that is no run
    power = place - source - 1
    if source[0] < 0 or power.max() > 4:
        raise ValueError("is malformed: expected runs of the old kind after a pixel")
    repeats = np.where(is_run, pixels[:, 3].astype(np.int64) << 8 * np.maximum(power, 0), 1)
    if (found := int(repeats.sum())) != count:
        what = "is truncated" if found < count else "is malformed"
        raise ValueError(f"{what}: has runs of {found} pixels in all; expected {count}")
    return np.repeat(pixels[source], repeats, axis=0)


def _runs(data: bytes, count: int, length: int) -> Rgbe:
    """(count, length, 4): scanlines, run-length encoded channel by channel, as since 1991."""
    out = bytearray()
    mark = b"\x02\x02" + length.to_bytes(2, "big")
    at = 0
    for y in range(count):
        if data[at : at + 4] != mark:
            what = "is truncated" if at + 4 > len(data) else "is malformed"
            raise ValueError(f"{what} at row {y}; expected a scanline of {length} pixels")
        at += 4
        for _ in range(4):
            left = length
            while left > 0:
                if at + 1 >= len(data):
                    raise ValueError(f"is truncated at row {y}; expected whole scanlines")
                run = data[at]
                is_run = run > 128
                run -= 128 if is_run else 0
                end = at + 2 if is_run else at + 1 + run
                if run == 0 or run > left or end > len(data):
                    what = "is truncated" if end > len(data) else "is malformed"
                    raise ValueError(f"{what} at row {y}; expected runs of {length} pixels in all")
                out += data[at + 1 : end] * run if is_run else data[at + 1 : end]
                left, at = left - run, end
    if at != len(data):
        raise ValueError(f"has {len(data) - at} bytes too many; expected {count} rows")
    return np.frombuffer(out, np.uint8).reshape(count, 4, length).transpose(0, 2, 1)


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


def open_pfm(file: Beginning) -> ImageFile:
    """Raises ValueError (what is wrong, what was expected)."""
    match = _PATTERN.match(file.head[:HEADER])
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
        check_length(file.size - match.end(), width * height * channels * 4)
    order = "<f4" if scale < 0.0 else ">f4"
    return PfmFile(file.path, width, height, is_grey=channels == 1, start=match.end(), order=order)


@dataclass(frozen=True)
class NpyFile(ImageFile):
    """array: memory-mapped, (height, width), or with 3 or 4 channels, the fourth being opacity."""

    array: Any = None

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        with open_input(self.path) as file:
            for rows in self.row_ranges():
                found = self.array[rows]
                if self.array.flags.c_contiguous:
                    # Read rather than mapped: rows that are done do not stay in memory.
                    file.seek(self.array.offset + rows.start * self.array.strides[0])
                    found = np.fromfile(file, found.dtype, found.size).reshape(found.shape)
                if found.dtype.itemsize > 8:  # long doubles
                    found = as_float64(found)
                opacity = found[..., 3] if self.has_opacity and with_opacity else None
                values = found[..., None] if self.is_grey else found[..., :3]
                yield StoredStrip(rows, values, opacity)


def open_npy(file: Beginning) -> ImageFile:
    """Raises ValueError (what is wrong, what was expected)."""
    array = map_npy(file.path)
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (3, 4)):
        raise ValueError(
            f"has the shape {array.shape}; expected (height, width), (height, width, 3), or with "
            "opacity (height, width, 4)"
        )
    height, width = array.shape[:2]
    return NpyFile(
        file.path,
        width,
        height,
        kind=f"float{min(64, 8 * array.dtype.itemsize)}",
        is_grey=array.ndim == 2,
        bits=8 * array.dtype.itemsize,
        has_opacity=array.ndim == 3 and array.shape[2] == 4,
        array=array,
    )


def map_npy(path: Path) -> npt.NDArray[Any]:
    """The array of floats, of any shape, in a file, memory-mapped.  Raises ValueError (what is
    wrong, what was expected), OSError."""
    open_input(path).close()  # not a pipe, which could not be mapped
    try:
        mapped: npt.NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # its parser is Python's, with any of its exceptions
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"cannot be read as NPY: {reason}; expected an array of floats") from None
    if mapped.dtype.kind != "f":
        raise ValueError(f"holds {mapped.dtype}; expected floats (float16, float32, float64)")
    return mapped
