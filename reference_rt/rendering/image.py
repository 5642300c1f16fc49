"""Pictures in files: EXR (float32, named channels, provenance) and PNG (8-bit sRGB)."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.rendering.render import Picture
from reference_rt.util.errors import UsageError
from reference_rt.util.files import replacing

SUFFIXES = (".exr", ".png")

# EXR channel names of each layer: the colour's are those that every viewer shows.
_CHANNELS: dict[str, tuple[str, ...]] = {
    "colour": ("R", "G", "B"),
    "distance": ("distance.Z",),
    "normal": ("normal.X", "normal.Y", "normal.Z"),
    "id": ("id.V",),
    "uv": ("uv.U", "uv.V"),
    "albedo": ("albedo.R", "albedo.G", "albedo.B"),
    "depth": ("depth.Z",),
    "variance": ("variance.R", "variance.G", "variance.B"),
}


def check_suffix(path: Path) -> None:
    """Raise UsageError if `write` does not support the file format."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: '{path.suffix}' is not supported; expected .exr or .png")


def write(path: Path, picture: Picture, provenance: Mapping[str, str]) -> None:
    """Write every layer to .exr, or the shown one to .png.  No partial file is ever left."""
    check_suffix(path)
    if path.suffix.lower() == ".png":
        write_png(path, display(picture), provenance)
    else:
        write_exr(path, channels(picture.layers), provenance)


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

    pixels = np.round(255.0 * np.clip(np.nan_to_num(image), 0.0, 1.0)).astype(np.uint8)
    pixels[~np.isfinite(image).all(axis=-1)] = (255, 0, 255)
    text = PngImagePlugin.PngInfo()
    for key, value in provenance.items():
        text.add_text(key, value)
    with replacing(path) as temporary:
        Image.fromarray(pixels).save(temporary, pnginfo=text)


def srgb(linear: npt.ArrayLike) -> FloatArray:
    """The sRGB transfer function (IEC 61966-2-1) of linear values; NaN and infinity are kept."""
    x = np.asarray(linear, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        high = 1.055 * np.power(np.maximum(x, 0.0031308), 1.0 / 2.4) - 0.055
        return np.where(x <= 0.0031308, 12.92 * x, high)


def display(picture: Picture) -> FloatArray:
    """The shown layer as display values (height, width, 3), nominally in [0, 1].

    Radiance: sRGB-encoded.  Distance: from white (nearest) to dark grey.  Normals: (n + 1) / 2.
    Id: a colour for each.  u and v: their fractional parts as red and green.  Misses of distances,
    normals and ids are black.
    """
    layer = picture.layers[picture.shown]
    if picture.shown == "colour":
        return srgb(layer)
    if picture.shown == "normal":
        missed = ~layer.any(axis=-1, keepdims=True)
        return np.where(missed, 0.0, 0.5 * (layer + 1.0))
    if picture.shown == "distance":
        return _grey(_nearness(layer))
    if picture.shown == "uv":
        return np.concatenate([np.mod(layer, 1.0), np.zeros_like(layer[..., :1])], axis=-1)
    return _palette(layer.astype(np.int64))


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
