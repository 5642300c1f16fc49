"""Deep OpenEXR images of scanlines: of each pixel the first sample, 0 where it has none.

Read here and not by the library, which makes an array of each pixel's samples, as many as the file
says (OpenEXR File Layout, "Deep Data"): memory stays in proportion to the file, and only one block
of lines is unpacked at a time.  Tiles of deep pixels are refused.
"""

import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.util.files import open_input
from reference_rt.util.memory import check_unpacked

Bytes = npt.NDArray[np.uint8]

_LINES = {"NO": 1, "RLE": 1, "ZIPS": 1, "ZIP": 16}
"""Lines that are compressed together, by the compression's name."""

_KINDS = {0: "<u4", 1: "<f2", 2: "<f4"}
_LONGEST_HEADER = 1 << 20

_DAMAGED = "cannot be read as EXR: it is truncated or damaged; expected a whole image"


def first_samples(
    path: Path, header: Mapping[str, Any], size: tuple[int, int], names: Sequence[str]
) -> dict[str, npt.NDArray[Any]]:
    """Planes (height, width) of some channels of a file of one part.

    header: of the library;  size: width and height.  Raises ValueError (what is wrong, what was
    expected), OSError.
    """
    with open_input(path) as file:
        content = file.read()
    try:
        return _planes(content, header, size, names)
    except (struct.error, zlib.error, KeyError, IndexError):
        raise ValueError(_DAMAGED) from None


def _planes(
    content: bytes, header: Mapping[str, Any], size: tuple[int, int], names: Sequence[str]
) -> dict[str, npt.NDArray[Any]]:
    width, height = size
    compression = str(header["compression"]).rpartition(".")[2].removesuffix("_COMPRESSION")
    if "tile" in str(header["type"]) or compression not in _LINES:
        raise ValueError("has deep pixels in tiles; expected deep pixels in lines, or flat ones")
    lines = _LINES[compression]
    start, kinds = _header(content)
    if not set(names) <= kinds.keys():
        raise ValueError(_DAMAGED)
    y0 = int(header["dataWindow"][0][1])
    blocks = -(-height // lines)
    if start + 8 * blocks > len(content):
        raise ValueError(_DAMAGED)
    offsets = np.frombuffer(content, "<u8", blocks, start)
    planes = {name: np.zeros((height, width), kinds[name]) for name in names}
    for offset in offsets.tolist():
        if offset + 28 > len(content):
            raise ValueError(_DAMAGED)
        y, packed_counts, packed, unpacked = struct.unpack_from("<iQQQ", content, offset)
        first, at = y - y0, offset + 28
        end = at + packed_counts + packed
        if not (0 <= first < height and first % lines == 0 and end <= len(content)):
            raise ValueError(_DAMAGED)
        check_unpacked(len(content), unpacked, "a block of lines", 4)
        count = min(lines, height - first)
        table = _unpacked(content[at : at + packed_counts], 4 * width * count, compression)
        ends = table.view("<i4").reshape(count, width).astype(np.int64)
        counts = np.diff(ends, axis=1, prepend=0)
        row = sum(np.dtype(kind).itemsize for kind in kinds.values())
        if counts.min() < 0 or row * int(ends[:, -1].sum()) != unpacked:
            raise ValueError(_DAMAGED)
        data = _unpacked(content[at + packed_counts : end], unpacked, compression)
        place = 0
        for k in range(count):
            total = int(ends[k, -1])
            for name, kind in kinds.items():
                stop = place + total * np.dtype(kind).itemsize
                if name in planes:
                    has = counts[k] > 0
                    samples = data[place:stop].view(kind)
                    planes[name][first + k, has] = samples[(ends[k] - counts[k])[has]]
                place = stop
    return planes


def _header(content: bytes) -> tuple[int, dict[str, str]]:
    """Where the header ends, and the type of each channel in the order of the file."""
    if struct.unpack_from("<I", content, 4)[0] & 0x1000:
        raise ValueError("has deep pixels in several parts; expected one part")
    at, kinds = 8, dict[str, str]()
    while content[at : at + 1] != b"\0":
        name_end = content.find(b"\0", at, _LONGEST_HEADER)
        kind_end = content.find(b"\0", name_end + 1, _LONGEST_HEADER)
        (size,) = struct.unpack_from("<I", content, kind_end + 1)
        name, at = content[at:name_end], kind_end + 5 + size
        if not 0 < name_end < kind_end or at >= min(len(content), _LONGEST_HEADER):
            raise ValueError(_DAMAGED)
        if name == b"channels":
            value = content[kind_end + 5 : at]
            place = 0
            while value[place : place + 1] not in (b"\0", b""):
                end = value.find(b"\0", place)
                if end < 0:
                    raise ValueError(_DAMAGED)
                channel = value[place:end].decode("latin-1")
                (code,) = struct.unpack_from("<I", value, end + 1)
                kinds[channel] = _KINDS[code]
                place = end + 17
    return at + 1, kinds


def _unpacked(packed: bytes, size: int, compression: str) -> Bytes:
    """`size` bytes that a block was packed from; those that did not shrink are as they were."""
    if len(packed) == size:
        return np.frombuffer(packed, np.uint8)
    if compression == "RLE":
        found = _runs(packed, size)
    else:
        found = zlib.decompressobj().decompress(packed, size)
    if len(found) != size:
        raise ValueError(_DAMAGED)
    # Each byte is the difference from the one before it, plus 128; the halves are interleaved.
    steps = np.frombuffer(found, np.uint8).astype(np.int64)
    steps[1:] -= 128
    whole = np.cumsum(steps).astype(np.uint8)
    out = np.empty(size, np.uint8)
    out[0::2], out[1::2] = whole[: (size + 1) // 2], whole[(size + 1) // 2 :]
    return out


def _runs(packed: bytes, size: int) -> bytes:
    """A count below 0 and so many bytes, or a count and a byte that comes once more often."""
    out, at = bytearray(), 0
    while at + 1 < len(packed) and len(out) <= size:
        count = packed[at] - 256 if packed[at] > 127 else packed[at]
        if count < 0:
            out += packed[at + 1 : at + 1 - count]
            at += 1 - count
        else:
            out += packed[at + 1 : at + 2] * (count + 1)
            at += 2
    return bytes(out)
