"""Images read by Pillow: PNG, JPEG, TIFF, WebP, BMP, TGA, PPM, GIF; of several frames the first."""

import logging
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.core.image_files.image_file import Beginning, ImageFile, StoredStrip
from reference_rt.util.files import open_input

_FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "BMP", "TGA", "PPM", "GIF")
"""The formats that are read, by what a file holds.  Pillow knows some forty, of which EPS starts
another program and many are read by code that few have tested."""

_SILENT = logging.NullHandler()

_KNOWN = f"EXR, HDR, PFM, NPY, {', '.join(_FORMATS)}"

_GREY = ("1", "L", "LA", "F")
"""Modes with one value per pixel."""

_GREY_OF_16 = ("I", "I;16", "I;16B", "I;16L")

_PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class PillowFile(ImageFile):
    """mode: Pillow's mode of the decoded image;  packed: Pillow's raw mode, the layout of pixels in
    a PNG file;  gamma: from the header of a PNG file that is not marked sRGB, else None."""

    mode: str = "RGB"
    packed: str = ""
    gamma: float | None = None

    def stored(self, with_opacity: bool = False) -> Iterator[StoredStrip]:
        with_opacity = with_opacity and self.has_opacity
        if self.bits == 16 and self.mode not in _GREY_OF_16:
            yield from self._deep_strips(with_opacity)
            return
        image = _decoded(self.path)
        for rows in self.row_ranges():
            part = image.crop((0, rows.start, self.width, rows.stop))
            if not self.is_integer:
                yield StoredStrip(rows, np.asarray(part)[..., None], None)
            elif self.bits == 16:
                codes = np.asarray(part, np.int64)
                if codes.min() < 0 or codes.max() > 65535:
                    raise ValueError("has grey values of more than 16 bits; expected 8 or 16")
                yield StoredStrip(rows, codes.astype(np.uint16)[..., None], None)
            elif self.is_grey and not with_opacity:
                yield StoredStrip(rows, np.asarray(part.convert("L"))[..., None], None)
            else:
                codes = np.asarray(part.convert("RGBA"))
                values = codes[..., : 1 if self.is_grey else 3]
                yield StoredStrip(rows, values, codes[..., 3] if with_opacity else None)

    def _deep_strips(self, with_opacity: bool) -> Iterator[StoredStrip]:
        """The strips of a PNG file with several channels of 16 bits.

        Pillow decodes only the high byte of each.  With the raw mode set to little-endian it
        decodes the low byte: two passes give all 16 bits.  For grey with opacity the raw mode RGBA
        makes it decode all four bytes as four channels.
        """
        if self.is_grey:
            image = _decoded(self.path, "RGBA")
            for rows in self.row_ranges():
                part = image.crop((0, rows.start, self.width, rows.stop))
                pairs = np.asarray(part).astype(np.uint16)
                grey, alpha = (256 * pairs[..., k] + pairs[..., k + 1] for k in (0, 2))
                yield StoredStrip(rows, grey[..., None], alpha if with_opacity else None)
            return
        channels = 4 if with_opacity else 3
        high = np.empty((self.height, self.width, channels), np.uint8)
        image = _decoded(self.path)
        for rows in self.row_ranges():
            part = image.crop((0, rows.start, self.width, rows.stop))
            high[rows] = np.asarray(part)[..., :channels]
        del image  # before the next one is decoded
        image = _decoded(self.path, self.packed.replace(";16B", ";16L"))
        for rows in self.row_ranges():
            part = image.crop((0, rows.start, self.width, rows.stop))
            codes = 256 * high[rows].astype(np.uint16) + np.asarray(part)[..., :channels]
            yield StoredStrip(rows, codes[..., :3], codes[..., 3] if with_opacity else None)


def open_with_pillow(file: Beginning) -> ImageFile:
    """Raises ValueError (what is wrong, what was expected), OSError."""
    head = file.head[:26]
    is_png = head.startswith(_PNG)
    if is_png and (len(head) < 26 or head[12:16] != b"IHDR"):
        raise ValueError("cannot be read as PNG: no header; expected a whole image")
    bits = struct.unpack(">B", head[24:25])[0] if is_png else 8
    with _opened(file.path) as image:
        mode, info = str(image.mode), image.info
        if image.format == "TIFF":
            _check_strips(image)
        packed = str(image.tile[0][3]) if image.tile else ""
        is_deep = bits == 16 or any(";16" in str(tile[3]) for tile in image.tile)
        if is_deep and not is_png and mode not in _GREY_OF_16:
            raise ValueError(
                "has colours of 16 bits, of which 8 would be lost; expected colours of 8, .png or "
                ".exr"
            )
        gamma = info.get("gamma") if is_png and "srgb" not in info else None
        bits = 16 if is_deep or mode in _GREY_OF_16 else 32 if mode == "F" else 8
        return PillowFile(
            file.path,
            image.width,
            image.height,
            kind="float32" if mode == "F" else f"uint{bits}",
            is_grey=mode in (*_GREY, *_GREY_OF_16) or packed.startswith("LA;16"),
            bits=bits,
            has_opacity=mode in ("RGBA", "LA", "PA", "La", "RGBa") or "transparency" in info,
            text={str(key): value for key, value in info.items() if isinstance(value, str)},
            mode=mode,
            packed=packed,
            gamma=gamma,
        )


def _check_strips(image: Any) -> None:
    """Raise ValueError for a file whose strips leave pixels out: Pillow makes these black, however
    many a damaged header asks for."""
    held = 0
    for tile in image.tile:
        left, top, right, bottom = tile[1]
        held += max(0, min(right, image.width) - left) * max(0, min(bottom, image.height) - top)
    if held < image.width * image.height:
        raise ValueError(
            f"cannot be read: its strips hold {held} of {image.width} x {image.height} pixels; "
            "expected a whole image"
        )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Pillow's image, of which only the header has been read.  Raises ValueError, OSError."""
    from PIL import Image, UnidentifiedImageError

    # Without a handler, what Pillow logs about a damaged file would appear beside our error.
    logging.getLogger("PIL").addHandler(_SILENT)
    most = Image.MAX_IMAGE_PIXELS
    try:
        # Pillow's limit is a constant; the callers' limit is the machine's memory.
        Image.MAX_IMAGE_PIXELS = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of odd metadata
            with open_input(path) as file, Image.open(file, formats=_FORMATS) as image:
                yield image
    except UnidentifiedImageError:
        raise ValueError(f"is not an image that can be read; expected {_KNOWN}") from None
    except (ValueError, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        message = str(error)
        raise ValueError(
            message if "; expected" in message else _unreadable(message, error)
        ) from None
    except Exception as error:  # decoders raise anything for invalid data
        raise ValueError(_unreadable(str(error), error)) from None
    finally:
        Image.MAX_IMAGE_PIXELS = most


def _unreadable(message: str, error: Exception) -> str:
    reason = " ".join(message.split()) or type(error).__name__
    return f"cannot be read: {reason}; expected a whole image"


def _decoded(path: Path, packed: str | None = None) -> Any:
    """Pillow's image with its pixels, decoded with the raw mode `packed`.  Raises ValueError,
    OSError."""
    with _opened(path) as image:
        if packed is not None:
            image.tile = [(*tile[:3], packed) for tile in image.tile]
        image.load()
    return image
