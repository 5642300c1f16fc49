"""Candidates from files and arrays: EXR, PNG, PFM, HDR and NPY as linear radiance."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.compare.primaries import SRGB, Chromaticities, conversion
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import read_headers
from reference_rt.core.image_files import ImageFile, open_image
from reference_rt.core.image_files.exr import ExrFile
from reference_rt.core.image_files.float_files import map_npy
from reference_rt.core.image_files.image_file import as_float64
from reference_rt.core.image_files.pillow import PillowFile
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError
from reference_rt.util.files import open_input

KNOWN = "EXR, PNG, PFM, HDR or NPY"
_BEGINNINGS = (b"v/1\x01", b"\x89PNG\r\n\x1a\n", b"PF", b"Pf", b"#?", b"\x93NUMPY")

MOST_NUMBERS = 1 << 27
"""Size limit of one file: 8192 x 4096 pixels of four channels, 1 GiB as float64.  A file that
declares more is refused as a mistake or an attack."""


@dataclass(frozen=True)
class Picture:
    """radiance: (height, width, 3) linear sRGB, row 0 on top, premultiplied by opacity;  opacity:
    (height, width) from 0 to 1, None if the file has none;  quantised: whether it was stored with
    8 bits per channel;  displayed: whether these are sRGB values, clamped to 1;  name: the file's
    name, or a description;  note: what was converted;  header: text found in the file."""

    radiance: FloatArray
    opacity: FloatArray | None = None
    quantised: bool = False
    displayed: bool = False
    name: str = "array"
    note: str = ""
    header: dict[str, str] = field(default_factory=dict)


def read_candidate(path: Path, layer: str = "") -> Picture:
    """The one picture in a file.  Raises ImageError (file, what is wrong, what was expected)."""
    pictures = read_candidates(path, layer)
    if len(pictures) > 1:
        raise ImageError(f"{path}: holds {len(pictures)} pictures; expected one")
    return pictures[0]


def read_candidates(path: Path, layer: str = "") -> tuple[Picture, ...]:
    """The pictures in a file, of which only NPY can hold several; see `read_candidate`.

    layer: prefix of the channel names in an EXR file, such as "diffuse" for diffuse.R.  The format
    is recognised by the file's first bytes, not by its name.
    """
    try:
        with open_input(path) as file:
            start = file.read(16)
        if start and not start.startswith(_BEGINNINGS):
            raise ValueError(f"is not an image that can be read; expected {KNOWN}")
        if start.startswith(b"\x93NUMPY") and not layer:
            array = map_npy(path)
            _check_shape(array.shape)
            return from_array(array, str(path))
        # Writers of .hdr round down: as Radiance decodes it, a picture has no bias.
        image = open_image(path, layer, radiance=True)
        return (_picture(image),)
    except FileNotFoundError:
        raise ImageError(f"{path}: there is no such file; expected an image") from None
    except ValueError as error:
        # A scene's file names a layer by a field, the gate by an option.
        options = "expected --layer (or --reference-layer) as"
        text = str(error).replace("expected `layer` as", options)
        raise ImageError(f"{path}: {text}") from None
    except OSError as error:
        raise ImageError(
            f"{path}: cannot be read: {error.strerror or error}; expected an image"
        ) from None


def _picture(image: ImageFile) -> Picture:
    """Raises ValueError, OSError."""
    channels = 4 if image.has_opacity else 3
    if isinstance(image, ExrFile):
        channels = max(channels, image.channels)
    check_size(image.width, image.height, channels)
    if isinstance(image, ExrFile) and image.windows[0] != image.windows[1]:
        ends = [f"({x0}, {y0}) to ({x1}, {y1})" for x0, y0, x1, y1 in image.windows]
        raise ValueError(f"has pixels from {ends[0]}; expected all of its display, {ends[1]}")
    if isinstance(image, PillowFile) and abs((image.gamma or 1 / 2.2) - 1 / 2.2) > 0.01:
        raise ValueError(f"is encoded with gamma {image.gamma:g}; expected sRGB")
    radiance = np.empty((image.height, image.width, 3))
    opacity = np.empty(radiance.shape[:2]) if image.has_opacity else None
    for rows, colours, covered in image.strips(linear if image.is_integer else None, True):
        radiance[rows] = colours
        if opacity is not None and covered is not None:
            opacity[rows] = covered
            if image.is_integer:
                # Integer formats store straight alpha; premultiply, as if composited over black.
                radiance[rows] *= covered[..., None]
    if image.is_integer and opacity is not None and not (opacity < 1.0).any():
        opacity = None
    note = ""
    if isinstance(image, ExrFile) and (found := _chromaticities(image.path, image.part)):
        radiance = radiance @ conversion(found, SRGB).T
        note = f"{image.path}: its header names other primaries than sRGB's, and was heeded"
    if image.note:
        note = "; ".join([*([note] if note else []), f"{image.path} {image.note}"])
    quantised = image.bits == 8
    return Picture(
        radiance,
        opacity,
        quantised,
        quantised and image.is_integer,
        str(image.path),
        note,
        image.text,
    )


def _chromaticities(path: Path, part: int) -> Chromaticities:
    """CIE x, y of red, green, blue and white by an EXR file's header; () for sRGB's, which are the
    default. Raises ValueError."""
    values = [float(v) for v in read_headers(path)[part].get("chromaticities", ())]
    found = tuple(zip(values[::2], values[1::2], strict=True))
    if np.allclose(found or SRGB, SRGB, atol=ROUNDED):
        return ()
    if not np.isfinite(values).all():
        raise ValueError("has chromaticities that are not finite")
    return found


ROUNDED = 1e-3
"""Difference of CIE x and y that the rounding of published primaries makes."""


def from_array(array: npt.ArrayLike, name: str = "array") -> tuple[Picture, ...]:
    """The pictures in an array (height, width, 3 or 4) or (replicates, height, width, 3 or 4) of
    floats; the fourth channel is opacity.  Raises ImageError."""
    values = np.asarray(array)
    if values.dtype.kind != "f":
        raise ImageError(f"{name}: holds {values.dtype}; expected floats of linear radiance")
    try:
        _check_shape(values.shape)
    except ValueError as error:
        raise ImageError(f"{name}: {error}") from None
    pictures = values if values.ndim == 4 else values[None]
    several = len(pictures) > 1
    found = tuple(
        Picture(
            as_float64(picture[..., :3]),
            as_float64(picture[..., 3]) if picture.shape[2] == 4 else None,
            name=f"{name}[{k}]" if several else name,
        )
        for k, picture in enumerate(pictures)
    )
    for picture in found if values.dtype.itemsize > 4 else ():
        beyond = np.isfinite(picture.radiance) & (np.abs(picture.radiance) > LARGEST)
        if beyond.any():
            first = picture.radiance[beyond][0]
            raise ImageError(
                f"{picture.name}: has the value {first:.3g}; expected radiance within "
                f"{LARGEST:.3g}, the largest float32, whose fourth powers can be added"
            )
    return found


LARGEST = float(np.finfo(np.float32).max)
"""Of the values of an array of float64."""


def pictures_of(given: Any) -> tuple[Picture, ...]:
    """The pictures in an array as `from_array` takes it, in a file, or in a list of these.  Raises
    ImageError."""
    found: list[Picture] = []
    for one in given if isinstance(given, list | tuple) else [given]:
        is_file = isinstance(one, str | os.PathLike)
        found += read_candidates(Path(one)) if is_file else from_array(one)
    return tuple(found)


def variance_of(path: Path) -> FloatArray:
    """(height, width, 3): the layer `variance` of an EXR file if it has one, else the picture in
    the file.  Raises ImageError."""
    layer = "variance" if "variance.R" in _channel_names(path) else ""
    found = read_candidate(path, layer).radiance
    if not (found >= 0.0).all():  # also refuses NaN
        raise ImageError(f"{path}: has variances that are negative or NaN; expected >= 0")
    return found


def _channel_names(path: Path) -> list[str]:
    try:
        return [c.name for header in read_headers(path) for c in header["channels"]]
    except (OSError, ValueError):
        return []  # reading it as a picture gives a better message


def check_size(width: int, height: int, channels: int, pictures: int = 1) -> None:
    """Refuse a picture without pixels, or too large a one.  Raises ValueError."""
    if min(width, height, channels, pictures) < 1:
        raise ValueError(f"has {width} x {height} pixels; expected at least one")
    if width * height * channels * pictures > MOST_NUMBERS:
        raise ValueError(
            f"declares {width} x {height} pixels of {channels} channels"
            + (f", {pictures} times" if pictures > 1 else "")
            + f"; expected at most {MOST_NUMBERS} values in total"
        )


def _check_shape(shape: tuple[int, ...]) -> None:
    """Raise ValueError unless an array of this shape holds pictures."""
    if len(shape) not in (3, 4) or shape[-1] not in (3, 4):
        raise ValueError(
            f"has the shape {shape}; expected (height, width, 3), with opacity (height, width, 4), "
            "or (replicates, height, width, 3 or 4)"
        )
    pictures = shape[0] if len(shape) == 4 else 1
    check_size(shape[-2], shape[-3], shape[-1], pictures)
