"""Candidates that are plain arrays of floats in a file: PFM, Radiance HDR and NPY.

Each reader takes a path that is known to begin like the format.  What a file declares is checked
against `MOST_NUMBERS` and against the file's own size before anything is allocated for it.  Raises
ValueError: what is wrong, and what was expected.
"""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.shapes.shape import FloatArray

MOST_NUMBERS = 1 << 27
"""Of one file: 8192 x 4096 pixels of four channels, and 1 GiB as float64.  What declares more is
taken for a mistake or an attack."""

_HEADER = 4096
"""Bytes that a header may take: it is searched for its end, and no further."""


def check_size(width: int, height: int, channels: int, pictures: int = 1) -> None:
    """Refuse a picture without pixels, or too large a one."""
    if min(width, height, channels, pictures) < 1:
        raise ValueError(f"has {width} x {height} pixels; expected at least one")
    if width * height * channels * pictures > MOST_NUMBERS:
        raise ValueError(
            f"declares {width} x {height} pixels of {channels} channels"
            + (f", {pictures} times" if pictures > 1 else "")
            + f"; expected at most {MOST_NUMBERS} numbers in all"
        )


def read_pfm(path: Path) -> FloatArray:
    """(height, width, 3) of a Portable Float Map, in colour or grey, row 0 on top."""
    with path.open("rb") as file:
        head = file.read(_HEADER)
        match = re.match(rb"P([Ff])\s+(\d{1,9})\s+(\d{1,9})\s+([-+.\deE]{1,32})\s", head)
        if match is None:
            raise ValueError("has a malformed PFM header; expected PF, width, height and scale")
        channels = 3 if match[1] == b"F" else 1
        width, height = int(match[2]), int(match[3])
        check_size(width, height, channels)
        try:
            scale = float(match[4])
        except ValueError:
            scale = math.nan
        if abs(scale) != 1.0:
            raise ValueError(
                f"has the scale {match[4].decode()}, which readers do not agree upon; expected 1 "
                "(big-endian) or -1 (little-endian)"
            )
        _check_length(path, match.end(), width * height * channels * 4)
        file.seek(match.end())
        values = np.frombuffer(file.read(), dtype="<f4" if scale < 0.0 else ">f4")
    rows = values.reshape(height, width, channels)[::-1]  # written from the bottom up
    return as_float64(np.repeat(rows, 4 - channels, axis=2)[..., :3])


def as_float64(values: npt.NDArray[Any]) -> FloatArray:
    """A copy; signalling NaNs, of which the processor tells, become others."""
    with np.errstate(invalid="ignore"):
        return np.array(values, dtype=np.float64)


def read_npy(path: Path) -> FloatArray:
    """The array of floats in a NumPy file, of any shape."""
    try:
        # Mapped, so that nothing is read of what is too large; no objects, which could run code.
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # its parser raises what Python's does
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"cannot be read as NPY: {reason}; expected an array of floats") from None
    if mapped.dtype.kind != "f":
        raise ValueError(f"holds {mapped.dtype}; expected floats (float16, float32, float64)")
    if mapped.size > MOST_NUMBERS:
        raise ValueError(f"holds {mapped.size} numbers; expected at most {MOST_NUMBERS}")
    return as_float64(mapped)


def read_hdr(path: Path) -> FloatArray:
    """(height, width, 3) of a Radiance picture (Ward 1991, "Real pixels"), row 0 on top.

    A mantissa m stands for the middle of its interval, m + 1/2, as in Radiance itself, since its
    writers round down; 0 stands for 0.  EXPOSURE and COLORCORR are undone.
    """
    with path.open("rb") as file:
        head = file.read(_HEADER)
        end = head.find(b"\n\n")
        match = re.match(rb"([-+])Y (\d{1,9}) ([-+])X (\d{1,9})\n", head[end + 2 :])
        if end < 0 or match is None:
            raise ValueError(
                "has a malformed HDR header; expected its lines and -Y height +X width"
            )
        lines = head[:end].decode("latin-1").splitlines()
        height, width = int(match[2]), int(match[4])
        check_size(width, height, 4)
        start = end + 2 + match.end()
        file.seek(start)
        # The shortest scanline: a mark, and of each channel runs of 127.
        least = height * (4 + 8 * math.ceil(width / 127)) if 8 <= width < 1 << 15 else 0
        if path.stat().st_size - start < least:
            raise ValueError("is truncated: too short for its size; expected whole scanlines")
        data = file.read()
    exposure = _exposure(lines)
    if data[:2] == b"\x02\x02" and 8 <= width < 1 << 15:
        rgbe = _runs(data, width, height)
    else:
        _check_flat(len(data), width * height * 4)
        rgbe = np.frombuffer(data, np.uint8).reshape(height, width, 4)
        if width > 1 and (rgbe[..., :3] == 1).all(axis=-1).any():
            raise ValueError("has runs of the old kind; expected those since 1991, or none")
    mantissa = rgbe[..., :3].astype(np.float64)
    mantissa[mantissa > 0.0] += 0.5
    power = np.ldexp(1.0, rgbe[..., 3:].astype(np.int64) - 136)
    values = np.where(rgbe[..., 3:] > 0, mantissa * power, 0.0) / exposure
    return np.ascontiguousarray(
        values[:: 1 if match[1] == b"-" else -1, :: 1 if match[3] == b"+" else -1]
    )


def _exposure(lines: list[str]) -> FloatArray:
    """(3,): by what the values were multiplied before they were written."""
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
    return found


def _runs(data: bytes, width: int, height: int) -> npt.NDArray[np.uint8]:
    """(height, width, 4) from scanlines that are run-length encoded channel by channel."""
    out = np.empty((height, 4, width), np.uint8)
    at, mark = 0, b"\x02\x02" + width.to_bytes(2, "big")
    for y in range(height):
        if data[at : at + 4] != mark:
            what = "is truncated" if at + 4 > len(data) else "is malformed"
            raise ValueError(f"{what} at row {y}; expected a scanline of {width} pixels")
        at += 4
        for channel in range(4):
            x = 0
            while x < width:
                if at + 1 >= len(data):
                    raise ValueError(f"is truncated at row {y}; expected {height} rows")
                count = data[at]
                is_run = count > 128
                count -= 128 if is_run else 0
                end = at + 2 if is_run else at + 1 + count
                if count == 0 or x + count > width or end > len(data):
                    what = "is truncated" if end > len(data) else "is malformed"
                    raise ValueError(f"{what} at row {y}; expected runs of {width} pixels in all")
                out[y, channel, x : x + count] = (
                    data[at + 1] if is_run else np.frombuffer(data, np.uint8, count, at + 1)
                )
                x, at = x + count, end
    if at != len(data):
        raise ValueError(f"has {len(data) - at} bytes too many; expected {height} rows")
    return out.transpose(0, 2, 1)


def _check_length(path: Path, start: int, expected: int) -> None:
    _check_flat(path.stat().st_size - start, expected)


def _check_flat(found: int, expected: int) -> None:
    if found < expected:
        raise ValueError(f"is truncated: {found} bytes of pixels; expected {expected}")
    if found > expected:
        raise ValueError(f"has {found} bytes of pixels; expected {expected}")
