"""Reading image files as linear sRGB texels."""

from pathlib import Path
from typing import Literal

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.util.memory import check_memory

MOST_BYTES_PER_PIXEL = 32
"""The most memory per pixel for reading an image: 24 bytes for its texels, 8 for the reader."""


def read_image(
    path: Path,
    encoding: Literal["auto", "srgb", "raw"],
    scale: float = 1.0,
    out: FloatArray | None = None,
) -> FloatArray:
    """(height, width, 3) linear sRGB times `scale`, row 0 on top, finite and at least 0.

    out (n, 3): if it is large enough, the colours are written to its beginning.  Raises ValueError
    (what is wrong, what was expected).
    """
    from reference_rt.core.image_files import open_image  # importing Pillow is slow

    try:
        image = open_image(path)
        pixels = image.height * image.width
        check_memory(pixels * MOST_BYTES_PER_PIXEL, f"{image.width} x {image.height} pixels")
        if out is None or len(out) < pixels:
            out = np.empty((pixels, 3))
        colours = out[:pixels].reshape(image.height, image.width, 3)
        is_srgb = image.is_integer if encoding == "auto" else encoding == "srgb"
        for rows, values, _ in image.strips(linear if is_srgb else None):
            _check_values(values, rows.start)
            with np.errstate(over="ignore"):
                np.multiply(values, scale, out=colours[rows])
            if not np.isfinite(colours[rows]).all():
                raise ValueError("a colour times the scale overflows; expected a smaller scale")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}; expected an image") from None
    except MemoryError:
        raise ValueError(f"{path}: does not fit into memory; expected a smaller image") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return colours


def pixels_of(path: Path) -> int:
    """The number of pixels according to a file's header; 0 where it cannot be read."""
    from reference_rt.core.image_files import open_image

    try:
        image = open_image(path)
    except (ValueError, OSError):
        return 0
    return image.height * image.width


def _check_values(values: FloatArray, first: int) -> None:
    """Raises ValueError for colours (rows, width, 3), from row `first` on, that are negative or not
    finite."""
    good = np.isfinite(values).all(axis=-1)
    if not good.all():
        y, x = np.argwhere(~good)[0]
        raise ValueError(
            f"the pixel at column {x}, row {first + y} is not finite; expected finite ones"
        )
    if (values < 0.0).any():
        y, x, _ = np.argwhere(values < 0.0)[0]
        raise ValueError(
            f"the pixel at column {x}, row {first + y} is negative; expected values of at least 0"
        )


def linear(encoded: FloatArray) -> FloatArray:
    """Decodes sRGB's transfer function to linear values (IEC 61966-2-1)."""
    low = encoded / 12.92
    high = np.power((np.maximum(encoded, 0.04045) + 0.055) / 1.055, 2.4)
    return np.where(encoded <= 0.04045, low, high)
