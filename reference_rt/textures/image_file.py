"""Reading image files as linear sRGB."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.core.image_files.image_file import Curve, ImageFile
from reference_rt.util.memory import check_memory

Encoding = Literal["auto", "srgb", "raw", "radiance"]
"""How the values of a file become linear ones: see `Bitmap.encoding`."""

READER = 8
"""The most bytes per pixel that reading an image takes beside its values."""


def read_image(path: Path, encoding: Encoding, scale: float = 1.0) -> FloatArray:
    """(height, width, 3) linear sRGB times `scale`, row 0 on top, finite and at least 0.  Raises
    ValueError (what is wrong, what was expected)."""
    with reading(path, encoding) as image:
        pixels = image.height * image.width
        check_memory((24 + READER) * pixels, f"{image.width} x {image.height} pixels")
        colours = np.empty((image.height, image.width, 3))
        for rows, values, _ in image.strips(curve_of(image, encoding)):
            check_values(values, rows.start)
            with np.errstate(over="ignore"):
                np.multiply(values, scale, out=colours[rows])
            if not np.isfinite(colours[rows]).all():
                raise ValueError("a colour times the scale overflows; expected a smaller scale")
    return colours


@contextmanager
def reading(path: Path, encoding: Encoding) -> Iterator[ImageFile]:
    """The image in a file, while it is read.  Raises ValueError (the file, what is wrong, what was
    expected) for all that goes wrong meanwhile."""
    from reference_rt.core.image_files import HdrFile, open_image  # importing Pillow is slow

    try:
        image = open_image(path, radiance=encoding == "radiance")
        if encoding == "radiance" and not isinstance(image, HdrFile):
            raise ValueError("is no Radiance image, which `encoding: radiance` is for")
        yield image
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}; expected an image") from None
    except MemoryError:
        raise ValueError(f"{path}: does not fit into memory; expected a smaller image") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def curve_of(image: ImageFile, encoding: Encoding) -> Curve | None:
    """The function that decodes the image's values; None where they are linear."""
    is_srgb = image.is_integer if encoding == "auto" else encoding == "srgb"
    return linear if is_srgb else None


def check_values(values: npt.NDArray[Any], first: int) -> None:
    """Raises ValueError for values (rows, width, channels), from row `first` on, that are negative
    or not finite."""
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
