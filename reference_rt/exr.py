"""OpenEXR files: named float32 channels, and text in the header."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.errors import ImageError
from reference_rt.files import replacing
from reference_rt.shapes.shape import FloatArray

_MAGIC = b"v/1\x01"


def write_exr(path: Path, channels: Mapping[str, FloatArray], header: Mapping[str, str]) -> None:
    """Channels (height, width) by name as float32, whole or not at all.  Raises ImageError."""
    import OpenEXR

    with np.errstate(over="ignore"):  # beyond float32 is infinity, which stays visible as such
        planes: dict[str, Any] = {
            name: np.ascontiguousarray(plane, np.float32) for name, plane in channels.items()
        }
    settings = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with replacing(path) as temporary:
        try:
            OpenEXR.File(settings | dict(header), planes).write(str(temporary))
        except RuntimeError as error:  # what the library raises for any failure to write
            raise OSError(None, str(error)) from None


def read_exr(path: Path) -> tuple[dict[str, FloatArray], dict[str, Any]]:
    """Channels (height, width) by name, as float64, and the header.  Raises ImageError."""
    import OpenEXR

    try:
        # The library would not say why it cannot open a file.
        with path.open("rb") as start:
            if start.read(4) != _MAGIC:
                raise TypeError("it does not begin as one")
        with OpenEXR.File(str(path), separate_channels=True) as file:
            header = dict(file.header())
            channels = {n: np.array(c.pixels, np.float64) for n, c in file.channels().items()}
    except (RuntimeError, OSError, TypeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise ImageError(f"{path}: cannot be read as EXR: {reason}") from None
    if len({plane.shape for plane in channels.values()}) > 1 or not channels:
        raise ImageError(f"{path}: cannot be read as EXR: expected channels of one size")
    return channels, header
