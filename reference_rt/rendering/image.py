"""Pictures in files: EXR (float32, named channels, provenance) and PNG (8-bit sRGB)."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError, UsageError
from reference_rt.util.files import replacing
from reference_rt.util.memory import check_memory

SUFFIXES = (".exr", ".png")


class Layered(Protocol):
    """A `Picture`: its layers, and the name of the one that is shown."""

    @property
    def layers(self) -> dict[str, FloatArray]: ...

    @property
    def shown(self) -> str: ...


# EXR channel names of each layer: the colour's are those that every viewer shows.
_CHANNELS: dict[str, tuple[str, ...]] = {
    "colour": ("R", "G", "B"),
    "distance": ("distance.Z",),
    "normal": ("normal.X", "normal.Y", "normal.Z"),
    "id": ("id.V",),
    "uv": ("uv.U", "uv.V"),
    "albedo": ("albedo.R", "albedo.G", "albedo.B"),
    "position": ("position.X", "position.Y", "position.Z"),
    "depth": ("depth.Z",),
    "variance": ("variance.R", "variance.G", "variance.B"),
    "bvh_steps": ("bvh_steps.V",),
    "intersections": ("intersections.V",),
}


def check_suffix(path: Path) -> None:
    """Raise UsageError if `write` does not support the file format."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: '{path.suffix}' is not supported; expected .exr or .png")


def write(path: Path, picture: Layered, provenance: Mapping[str, str]) -> None:
    """Write every layer to .exr, or the shown one to .png.  No partial file is ever left."""
    check_suffix(path)
    if path.suffix.lower() == ".png":
        write_png(path, display(picture), provenance)
    else:
        write_exr(path, channels(picture.layers), provenance)


def read_image(path: str | os.PathLike[str], layer: str = "") -> FloatArray:
    """(height, width, 3) linear values of an image file, row 0 on top; 8-bit files are decoded from
    sRGB.

    layer: the prefix of the channels' names of an EXR file, such as "albedo".  Raises ImageError.
    """
    from reference_rt.core.image_files import open_image  # importing Pillow is slow

    try:
        image = open_image(Path(path), layer)
        check_memory(image.width * image.height * 32, f"{image.width} x {image.height} pixels")
        found = np.empty((image.height, image.width, 3))
        for rows, colours, _ in image.strips(linear if image.is_integer else None):
            found[rows] = colours
    except OSError as error:
        reason = error.strerror or error
        raise ImageError(f"{path}: cannot be read: {reason}; expected an image") from None
    except (ValueError, MemoryError) as error:
        raise ImageError(f"{path}: {error}") from None
    return found


def channels(layers: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The layers (height, width[, channels]) of a picture as planes (height, width), by EXR channel
    name."""
    planes = {}
    for name, layer in layers.items():
        for k, channel in enumerate(_CHANNELS[name]):
            planes[channel] = np.atleast_3d(layer)[..., k]
    return planes


def write_png(path: Path, image: FloatArray, provenance: Mapping[str, str]) -> None:
    """An (height, width, 3) image of display values in [0, 1] as 8 bits; NaN becomes magenta."""
    from PIL import Image, PngImagePlugin

    text = PngImagePlugin.PngInfo()
    for key, value in provenance.items():
        text.add_text(key, value)
    with replacing(path) as temporary:
        Image.fromarray(eight_bits(image)).save(temporary, pnginfo=text)


def eight_bits(image: FloatArray) -> npt.NDArray[np.uint8]:
    """Display values (height, width, 3) in [0, 1] as 8 bits; what is not finite becomes magenta."""
    pixels = np.round(255.0 * np.clip(np.nan_to_num(image), 0.0, 1.0)).astype(np.uint8)
    pixels[~np.isfinite(image).all(axis=-1)] = (255, 0, 255)
    return pixels


def srgb(radiance: npt.ArrayLike) -> FloatArray:
    """The sRGB transfer function (IEC 61966-2-1) of linear values; NaN and infinity are kept."""
    x = np.asarray(radiance, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        high = 1.055 * np.power(np.maximum(x, 0.0031308), 1.0 / 2.4) - 0.055
        return np.where(x <= 0.0031308, 12.92 * x, high)


def display(picture: Layered) -> FloatArray:
    """The shown layer as display values (height, width, 3), nominally in [0, 1].

    Radiance, albedo and variance: sRGB-encoded.  Distance and depth: from white (nearest) to dark
    grey.  Normals: (n + 1) / 2.  Position: each coordinate from 0 to 1 over what is hit.  Id: a
    colour for each.  u and v: their fractional parts as red and green.  Of bvh_steps
    and intersections: from blue for 0 by red to yellow for the most.  Misses of distances, normals,
    positions and ids are black.
    """
    layer = picture.layers[picture.shown]
    if picture.shown in ("colour", "albedo", "variance"):
        return srgb(layer)
    if picture.shown == "position":
        return _spread(layer)
    if picture.shown == "normal":
        missed = ~layer.any(axis=-1, keepdims=True)
        return np.where(missed, 0.0, 0.5 * (layer + 1.0))
    if picture.shown in ("distance", "depth"):
        return _grey(_nearness(layer))
    if picture.shown == "uv":
        return np.concatenate([np.mod(layer, 1.0), np.zeros_like(layer[..., :1])], axis=-1)
    if picture.shown in ("bvh_steps", "intersections"):
        return _heat(layer)
    return _palette(layer.astype(np.int64))


def _heat(values: FloatArray) -> FloatArray:
    """From blue for 0 by red to yellow for the largest value."""
    at = values / max(values.max(), 1.0)
    ramps = (0.05, 0.45, 0.85, 1.0, 1.0), (0.05, 0.05, 0.25, 0.6, 1.0), (0.35, 0.55, 0.4, 0.1, 0.6)
    return np.stack([np.interp(at, np.linspace(0.0, 1.0, 5), ramp) for ramp in ramps], axis=-1)


def _spread(positions: FloatArray) -> FloatArray:
    """Each coordinate from 0 to 1 over what is hit; misses, (0, 0, 0), are black."""
    hit = np.asarray((positions != 0.0).any(axis=-1))
    if not hit.any():
        return np.zeros_like(positions)
    low, high = positions[hit].min(axis=0), positions[hit].max(axis=0)
    scaled = (positions - low) / np.where(high > low, high - low, 1.0)
    return np.where(hit[..., None], scaled, 0.0)


def _nearness(distance: FloatArray) -> FloatArray:
    hit = np.isfinite(distance)
    if not hit.any():
        return np.zeros_like(distance)
    near, far = distance[hit].min(), distance[hit].max()
    # The farthest hit is 0.1, which tells it from a miss.
    scale = 0.9 / (far - near) if far > near else 0.0
    return np.where(hit, 1.0 - scale * (np.where(hit, distance, near) - near), 0.0)


def _grey(values: FloatArray) -> FloatArray:
    return np.repeat(values[..., None], 3, axis=-1)


def _palette(ids: npt.NDArray[np.int64]) -> FloatArray:
    """Hues a golden angle apart, so that consecutive ids have clearly different colours."""
    hue = np.mod(ids[..., None] * 0.6180339887498949 + np.array([0.0, 2 / 3, 1 / 3]), 1.0)
    colour = np.clip(np.abs(6.0 * hue - 3.0) - 1.0, 0.0, 1.0) * 0.75 + 0.2
    return np.where(ids[..., None] < 0, 0.0, colour)
