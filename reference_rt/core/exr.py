"""Reading and writing OpenEXR files: named float32 channels, and text in the header."""

import ctypes
import io
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.util.errors import ImageError
from reference_rt.util.files import open_input, replacing

_MAGIC = b"v/1\x01"


def write_exr(path: Path, channels: Mapping[str, FloatArray], header: Mapping[str, str]) -> None:
    """Writes channels (height, width) by name as float32, atomically.  Raises ImageError."""
    import OpenEXR

    with np.errstate(over="ignore"):  # overflow of float32 becomes infinity
        planes: dict[str, Any] = {
            name: np.ascontiguousarray(plane, np.float32) for name, plane in channels.items()
        }
    settings = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with replacing(path) as temporary:
        try:
            OpenEXR.File(settings | dict(header), planes).write(_name(temporary))
        except RuntimeError as error:  # raised by the library for any failure to write
            raise OSError(None, str(error)) from None


EXR_ROWS = 16
"""Rows that are compressed together: `exr_rows` takes as many at a time."""


@contextmanager
def exr_rows(
    path: Path, size: tuple[int, int], names: Sequence[str], header: Mapping[str, str]
) -> Iterator[Callable[[Mapping[str, FloatArray]], None]]:
    """Yields a function that adds EXR_ROWS rows, at the end fewer, to an image of float32 channels,
    from the top, without the whole image in memory; the file is there when all rows are.

    size: width and height;  names: of the channels.  Raises ImageError.
    """
    import Imath
    import OpenEXR

    settings = OpenEXR.Header(*size)
    channel = Imath.Channel(Imath.PixelType(Imath.PixelType.FLOAT))
    settings["channels"] = dict.fromkeys(names, channel)
    settings["compression"] = Imath.Compression(Imath.Compression.ZIP_COMPRESSION)
    settings |= {name: text.encode() for name, text in header.items()}
    with replacing(path) as temporary:
        try:
            file = OpenEXR.OutputFile(str(temporary), settings)

            def put(planes: Mapping[str, FloatArray]) -> None:
                with np.errstate(over="ignore"):  # overflow of float32 becomes infinity
                    rows = {
                        name: np.ascontiguousarray(plane, np.float32)
                        for name, plane in planes.items()
                    }
                count = len(next(iter(rows.values())))
                file.writePixels({name: plane.tobytes() for name, plane in rows.items()}, count)

            try:
                yield put
            finally:
                file.close()
        except (RuntimeError, UnicodeError) as error:  # raised by the library
            raise OSError(None, str(error)) from None


def read_exr(path: Path) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """Channels (height, width) by name, as float64, and the header.  Raises ImageError."""
    try:
        header = read_headers(path)[0]
        channels = {n: np.array(plane, np.float64) for n, plane in read_planes(path).items()}
        if len({plane.shape for plane in channels.values()}) > 1 or not channels:
            raise ValueError("cannot be read as EXR: expected channels of one size")
    except OSError as error:
        raise ImageError(f"{path}: cannot be read as EXR: {error.strerror}") from None
    except ValueError as error:
        raise ImageError(f"{path}: {error}") from None
    return channels, header


def read_headers(path: Path) -> list[dict[str, Any]]:
    """The headers of an EXR file's parts.  Raises ValueError (what is wrong), OSError."""
    with open_input(path) as start:
        if start.read(4) != _MAGIC:
            raise ValueError("cannot be read as EXR: it does not begin as one")
    return [header for header, _ in _opened(path, header_only=True)]


def read_planes(path: Path, part: int = 0) -> dict[str, npt.NDArray[Any]]:
    """Channels by name, (height, width) unless they are subsampled, in the file's own data type.
    Raises ValueError (what is wrong), OSError."""
    open_input(path).close()
    return _opened(path, separate_channels=True)[part][1]


def _opened(path: Path, **how: bool) -> list[tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]]:
    """Of each part its header and its planes."""
    import OpenEXR

    damaged = "cannot be read as EXR: it is truncated or damaged; expected a whole image"
    try:
        with _silent(), OpenEXR.File(_name(path), **how) as file:
            parts = [
                (dict(part.header), {name: c.pixels for name, c in part.channels.items()})
                for part in file.parts
            ]
    except (RuntimeError, OSError, TypeError, ValueError):  # its messages say nothing to users
        raise ValueError(damaged) from None
    has_pixels = all(hasattr(plane, "shape") for _, planes in parts for plane in planes.values())
    if not parts or ("separate_channels" in how and not has_pixels):
        raise ValueError(damaged)  # the library returns channels without pixels
    return parts


def _name(path: Path) -> str | bytes:
    """The file name as the library takes it: names need not be UTF-8."""
    return str(path) if sys.platform == "win32" else os.fsencode(path)


@contextmanager
def _silent() -> Iterator[None]:
    """Suppresses standard output and error, to which the library writes from C++ and from Python:
    the caller reports a damaged file in one line."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    saved = os.dup(1), os.dup(2)
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            for number in (1, 2):
                os.dup2(nowhere, number)
            yield
    finally:
        if sys.platform != "win32":
            ctypes.CDLL(None).fflush(None)  # flush C's buffers
        for number, original in zip((1, 2), saved, strict=True):
            os.dup2(original, number)
        for number in (nowhere, *saved):
            os.close(number)
