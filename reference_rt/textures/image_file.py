"""Images from files, as linear sRGB."""

import logging
import warnings
from pathlib import Path
from typing import Literal

import numpy as np

from reference_rt.shapes.shape import FloatArray

_SILENT = logging.NullHandler()


def read_image(path: Path, encoding: Literal["auto", "srgb", "raw"]) -> FloatArray:
    """(height, width, 3) linear sRGB, row 0 on top, finite and at least 0.

    Raises ValueError (what is wrong, what was expected).
    """
    if path.suffix.lower() == ".exr":
        values, is_integer = _read_exr(path), False
    else:
        values, is_integer = _read_with_pillow(path)
    is_srgb = is_integer if encoding == "auto" else encoding == "srgb"
    if values.size == 0:
        raise ValueError(f"{path}: has no pixels; expected an image")
    bad = ~np.isfinite(values)
    if bad.any():
        y, x, _ = np.argwhere(bad)[0]
        raise ValueError(
            f"{path}: {np.count_nonzero(bad.any(axis=-1))} pixels are not finite, the first at "
            f"column {x}, row {y}; expected finite ones"
        )
    if (values < 0.0).any():
        y, x, _ = np.argwhere(values < 0.0)[0]
        raise ValueError(
            f"{path}: the pixel at column {x}, row {y} is negative; expected values of at least 0"
        )
    return np.ascontiguousarray(linear(values) if is_srgb else values)


def linear(encoded: FloatArray) -> FloatArray:
    """Linear values of sRGB's transfer function (IEC 61966-2-1)."""
    low = encoded / 12.92
    high = np.power((np.maximum(encoded, 0.04045) + 0.055) / 1.055, 2.4)
    return np.where(encoded <= 0.04045, low, high)


def _read_exr(path: Path) -> FloatArray:
    from reference_rt.errors import ImageError
    from reference_rt.exr import read_exr

    try:
        channels, _ = read_exr(path)
    except ImageError as error:
        raise ValueError(f"{error}; expected an image") from None
    if all(name in channels for name in "RGB"):
        return np.stack([channels[name] for name in "RGB"], axis=-1)
    if "Y" in channels and "RY" not in channels:  # with which it would be in colour
        return _grey(channels["Y"])
    raise ValueError(f"{path}: has channels {', '.join(channels)}; expected R, G, B or Y")


def _read_with_pillow(path: Path) -> tuple[FloatArray, bool]:
    """(height, width, 3) of whatever Pillow reads, and whether these were integers, which are
    scaled to 0..1; without opacity."""
    from PIL import Image, UnidentifiedImageError

    # What Pillow logs of rubbish would stand beside the one line of the error.
    logging.getLogger("PIL").addHandler(_SILENT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a large size, and of odd metadata
            with Image.open(path) as image:
                if image.mode in ("I", "I;16", "I;16B", "I;16L"):
                    return _grey(np.asarray(image, np.float64) / 65535.0), True
                if image.mode == "F":
                    return _grey(np.asarray(image, np.float64)), False
                deep = any(";16" in str(tile.args) for tile in image.tile)
                colours = np.asarray(image.convert("RGBA"))[..., :3] / 255.0
    except UnidentifiedImageError:
        raise ValueError(f"{path}: is not an image that can be read; expected one") from None
    except Exception as error:  # decoders raise what they like at rubbish
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise ValueError(
            f"{path}: cannot be read: {reason or type(error).__name__}; expected an image"
        ) from None
    if deep:
        raise ValueError(
            f"{path}: has colours of 16 bits, of which 8 would be lost; expected colours of 8, "
            "grey of 16, or .exr"
        )
    return colours, True


def _grey(values: FloatArray) -> FloatArray:
    return np.repeat(values[..., None], 3, axis=-1)
