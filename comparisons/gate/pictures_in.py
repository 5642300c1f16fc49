"""Candidates from files and arrays: EXR, PNG, PFM, HDR and NPY as linear radiance."""

import struct
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.gate.formats import as_float64, check_size, read_hdr, read_npy, read_pfm
from reference_rt.errors import ImageError
from reference_rt.exr import read_exr
from reference_rt.shapes.shape import FloatArray
from reference_rt.textures.image_file import linear

KNOWN = "EXR, PNG, PFM, HDR or NPY"


@dataclass(frozen=True)
class Picture:
    """radiance: (height, width, 3) linear sRGB, row 0 on top, premultiplied by opacity;  opacity:
    (height, width) from 0 to 1, None where the file has none;  quantised: whether it was kept in
    8 bits a channel;  displayed: whether these are codes of sRGB, which end at 1;  name: the
    file's, or what stands for it;  header: text found in the file."""

    radiance: FloatArray
    opacity: FloatArray | None = None
    quantised: bool = False
    displayed: bool = False
    name: str = "array"
    header: dict[str, str] = field(default_factory=dict)


def read_candidate(path: Path, layer: str = "") -> Picture:
    """The one picture in a file.  Raises ImageError (file, what is wrong, what was expected)."""
    pictures = read_candidates(path, layer)
    if len(pictures) > 1:
        raise ImageError(f"{path}: holds {len(pictures)} pictures; expected one")
    return pictures[0]


def read_candidates(path: Path, layer: str = "") -> tuple[Picture, ...]:
    """The pictures in a file, of which only NPY can hold several; see `read_candidate`.

    layer: of an EXR file, the prefix of its channels' names, such as "diffuse" for diffuse.R.  The
    format is told by how the file begins, not by its name.
    """
    try:
        if not path.exists():
            raise ValueError("there is no such file; expected an image")
        if not path.is_file():  # what never ends, such as a pipe, must not be read
            raise ValueError("is not a file; expected an image")
        with path.open("rb") as file:
            start = file.read(16)
        if not start:
            raise ValueError("is empty; expected an image")
        if start.startswith(b"v/1\x01"):
            return (_exr(path, layer),)
        if layer:
            raise ValueError(f"has no layer '{layer}': only EXR has layers")
        if start.startswith(b"\x89PNG\r\n\x1a\n"):
            return (_png(path),)
        if start.startswith(b"\x93NUMPY"):
            return from_array(read_npy(path), str(path))
        if start.startswith((b"PF", b"Pf")):
            return (Picture(read_pfm(path), name=str(path)),)
        if start.startswith(b"#?"):
            return (Picture(read_hdr(path), quantised=True, name=str(path)),)
        raise ValueError(f"is not an image that can be read; expected {KNOWN}")
    except ValueError as error:
        raise ImageError(f"{path}: {error}") from None
    except OSError as error:
        raise ImageError(
            f"{path}: cannot be read: {error.strerror or error}; expected an image"
        ) from None


def from_array(array: npt.ArrayLike, name: str = "array") -> tuple[Picture, ...]:
    """The pictures in an array (height, width, 3 or 4) or (replicates, height, width, 3 or 4) of
    floats; the fourth channel is opacity.  Raises ImageError."""
    values = np.asarray(array)
    if values.dtype.kind != "f":
        raise ImageError(f"{name}: holds {values.dtype}; expected floats of linear radiance")
    if values.ndim not in (3, 4) or values.shape[-1] not in (3, 4):
        raise ImageError(
            f"{name}: has the shape {values.shape}; expected (height, width, 3), with opacity "
            "(height, width, 4), or (replicates, height, width, 3 or 4)"
        )
    pictures = values if values.ndim == 4 else values[None]
    try:
        check_size(pictures.shape[2], pictures.shape[1], pictures.shape[3], len(pictures))
    except ValueError as error:
        raise ImageError(f"{name}: {error}") from None
    several = len(pictures) > 1
    return tuple(
        Picture(
            as_float64(picture[..., :3]),
            as_float64(picture[..., 3]) if picture.shape[2] == 4 else None,
            name=f"{name}[{k}]" if several else name,
        )
        for k, picture in enumerate(pictures)
    )


def variance_of(path: Path) -> FloatArray:
    """(height, width, 3): the layer `variance` of an EXR file, or its R, G, B, or those of another
    format.  Raises ImageError."""
    layer = "variance" if "variance.R" in _channel_names(path) else ""
    found = read_candidate(path, layer).radiance
    if not (found >= 0.0).all():  # also refuses NaN
        raise ImageError(f"{path}: has variances that are negative or not numbers; expected >= 0")
    return found


def _channel_names(path: Path) -> Sequence[str]:
    try:
        with path.open("rb") as file:
            if file.read(4) != b"v/1\x01":
                return ()
        return list(read_exr(path)[0])
    except (OSError, ImageError):
        return ()  # which reading it says better


def _exr(path: Path, layer: str) -> Picture:
    _check_exr_size(path)
    try:
        channels, header = read_exr(path)
    except ImageError:  # the library does not say which
        raise ValueError("is truncated or damaged; expected a whole EXR image") from None
    prefix = f"{layer}." if layer else ""
    if all(prefix + name in channels for name in "RGB"):
        radiance = np.stack([channels[prefix + name] for name in "RGB"], axis=-1)
    elif prefix + "Y" in channels and prefix + "RY" not in channels:
        radiance = np.repeat(channels[prefix + "Y"][..., None], 3, axis=-1)
    else:
        expected = ", ".join(prefix + name for name in "RGB")
        raise ValueError(f"has channels {_list(channels)}; expected {expected}, or {prefix}Y")
    text = {key: value for key, value in header.items() if isinstance(value, str)}
    return Picture(radiance, channels.get(prefix + "A"), name=str(path), header=text)


def _check_exr_size(path: Path) -> None:
    """Refuse what is too large, or has its pixels elsewhere than the picture is."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            header: dict[str, Any] = dict(file.header())
    except (RuntimeError, OSError, TypeError, ValueError):
        raise ValueError("has a truncated or damaged header; expected a whole EXR image") from None
    windows = [header[name] for name in ("dataWindow", "displayWindow")]
    (x0, y0), (x1, y1) = ([int(n) for n in corner] for corner in windows[0])
    check_size(x1 - x0 + 1, y1 - y0 + 1, max(len(header["channels"]), 1))
    if not np.array_equal(windows[0], windows[1]):
        ends = [" to ".join(str(tuple(map(int, corner))) for corner in w) for w in windows]
        raise ValueError(f"has pixels from {ends[0]}; expected all of its display, {ends[1]}")


def _list(names: Any, most: int = 12) -> str:
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _png(path: Path) -> Picture:
    """sRGB by its transfer function, of 8 or 16 bits."""
    from PIL import Image

    with path.open("rb") as file:
        head = file.read(26)
    if len(head) < 26 or head[12:16] != b"IHDR":
        raise ValueError("cannot be read as PNG: no header; expected a whole image")
    width, height, bits, _ = struct.unpack(">IIBB", head[16:26])
    check_size(width, height, 4)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a large size, and of odd metadata
            with Image.open(path) as image:
                info = image.info
                values = _deep(path) if bits == 16 else _shallow(image)
    except Exception as error:  # decoders raise what they like at rubbish
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise ValueError(
            f"cannot be read as PNG: {reason or type(error).__name__}; expected a whole image"
        ) from None
    gamma = info.get("gamma")
    if gamma is not None and "srgb" not in info and abs(gamma - 1 / 2.2) > 0.01:
        raise ValueError(f"is encoded with gamma {gamma:g}; expected sRGB")
    # Colours beside a transparent pixel's edge are not its own: what is seen is over black.
    radiance = linear(values[..., :3]) * values[..., 3:]
    has_opacity = bool((values[..., 3] < 1.0).any())
    text = {str(key): value for key, value in info.items() if isinstance(value, str)}
    opacity = values[..., 3] if has_opacity else None
    return Picture(radiance, opacity, bits < 16, bits < 16, str(path), text)


def _shallow(image: Any) -> FloatArray:
    return np.asarray(image.convert("RGBA"), np.float64) / 255.0


def _deep(path: Path) -> FloatArray:
    """(height, width, 4) from 0 to 1 of a PNG file with 16 bits a channel.

    Of colours, Pillow unpacks the high byte of each number.  Told to take them for little-endian
    it unpacks the low byte: two readings together are all 16 bits.
    """
    high, kind = _unpacked(path, None)
    if kind.startswith("I"):  # grey, for which it has a type
        grey = high / 65535.0
        return np.stack([grey, grey, grey, np.ones_like(grey)], axis=-1)
    if kind.startswith("LA"):  # as if it were four channels of 8 bits
        bytes_of, _ = _unpacked(path, "RGBA")
        grey, alpha = (256.0 * bytes_of[..., k] + bytes_of[..., k + 1] for k in (0, 2))
        return np.stack([grey, grey, grey, alpha], axis=-1) / 65535.0
    low, _ = _unpacked(path, kind.replace(";16B", ";16L"))
    values = (256.0 * high + low) / 65535.0
    if values.shape[2] == 4:
        return np.asarray(values)
    return np.concatenate([values, np.ones_like(values[..., :1])], axis=-1)


def _unpacked(path: Path, kind: str | None) -> tuple[FloatArray, str]:
    """What Pillow makes of the pixels, taken for `kind`, and what it takes them for by itself."""
    from PIL import Image

    with Image.open(path) as image:
        own = str(image.tile[0][3])
        if kind is not None:
            image.tile = [(*tile[:3], kind) for tile in image.tile]  # type: ignore[misc]
        return np.asarray(image, np.float64), own
