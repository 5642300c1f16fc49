"""Files of pictures, as other programs write them: for the tests of the gate."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr


def png(path: Path, values: np.ndarray, bits: int, more: bytes = b"") -> Path:
    """A PNG of values (height, width, channels), 1 to 4 of them, without filters."""
    height, width, channels = values.shape
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    rows = values.astype(">u2" if bits == 16 else "u1").reshape(height, -1)
    data = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))
    head = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    chunks = [chunk(b"IHDR", head), more, chunk(b"IDAT", data), chunk(b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    return path


def chunk(name: bytes, data: bytes) -> bytes:
    check = zlib.crc32(name + data)
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", check)


def pfm(values: np.ndarray, scale: str, kind: str = "<f4") -> bytes:
    letter = b"PF" if values.shape[2] == 3 else b"Pf"
    head = b"%s\n%d %d\n%s\n" % (letter, values.shape[1], values.shape[0], scale.encode())
    return head + values[::-1].astype(kind).tobytes()


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def exr(path: Path, picture: FloatArray, names: str = "RGB", prefix: str = "") -> Path:
    write_exr(path, {prefix + n: picture[..., k % 3] for k, n in enumerate(names)}, {})
    return path


def rgbe(picture: FloatArray) -> np.ndarray:
    """(height, width, 4) as Radiance writes it: mantissas rounded down (Ward 1991)."""
    mantissa, exponent = np.frexp(picture.max(axis=-1, keepdims=True))
    scale = np.where(mantissa > 0.0, 256.0 * 2.0 ** -exponent.astype(np.float64), 0.0)
    return np.concatenate([picture * scale, exponent + 128], axis=-1).astype(np.uint8)


def hdr(values: np.ndarray, runs: bool, axes: str = "-Y {} +X {}", more: str = "") -> bytes:
    """A Radiance file of values (height, width, 4)."""
    height, width = values.shape[:2]
    head = (
        f"#?RADIANCE\n# a comment\n{more}FORMAT=32-bit_rle_rgbe\n\n{axes.format(height, width)}\n"
    )
    if not runs:
        return head.encode() + values.tobytes()
    body = bytearray()
    for row in values:
        body += b"\2\2" + struct.pack(">H", width)
        for channel in row.T:
            x = 0
            while x < width:
                same = 1
                while x + same < width and same < 127 and channel[x + same] == channel[x]:
                    same += 1
                body += bytes([128 + same, channel[x]]) if same > 2 else bytes([1, channel[x]])
                x += same if same > 2 else 1
    return head.encode() + bytes(body)
