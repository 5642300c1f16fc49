"""Pictures of values with a sign: red above 0, blue below, white at 0, with a scale below."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.image import write_png

_ENDS = {True: (0.70, 0.06, 0.10), False: (0.08, 0.25, 0.65)}
"""Display values of the largest and of the least."""

_WIDTH = 320
"""Pixels that a picture has at least, so that its scale can be read: small ones are enlarged."""

_BAR, _TEXT = 12, 16
"""Heights of the scale's bar and of a line of text, in pixels."""


def signed(values: FloatArray, span: float) -> FloatArray:
    """Display values (..., 3) of values (...) from -span to span."""
    share = np.clip(np.abs(values) / span, 0.0, 1.0)[..., None]
    end = np.where(values[..., None] > 0.0, _ENDS[True], _ENDS[False])
    return np.asarray(1.0 + share * (end - 1.0))


def write_signed(path: Path, picture: FloatArray, unit: str, header: Mapping[str, str]) -> None:
    """Write a picture (height, width, 3) as a .png: of each pixel the channel that is farthest
    from 0, from -s to s, where s is the largest that is not among the outermost 0.1 %.  A file
    appears whole or not at all.  unit: of the values.  Raises ImageError."""
    from PIL import Image, ImageDraw

    at = np.abs(np.nan_to_num(picture)).argmax(axis=-1)[..., None]
    values = np.take_along_axis(picture, at, axis=-1)[..., 0]
    finite = np.abs(values[np.isfinite(values)])
    span = float(np.quantile(finite, 0.999, method="higher")) if finite.size else 0.0
    span = span or float(finite.max(initial=0.0)) or 1.0
    times = -(-_WIDTH // values.shape[1])
    shown = signed(values, span).repeat(times, axis=0).repeat(times, axis=1)
    width = shown.shape[1]
    bar = signed(np.linspace(-span, span, width), span)[None].repeat(_BAR, axis=0)
    text = Image.new("RGB", (width, 2 * _TEXT), "white")
    draw = ImageDraw.Draw(text)
    for x, word, anchor in ((2, -span, "lt"), (width // 2, 0.0, "mt"), (width - 2, span, "rt")):
        draw.text((x, 2), f"{word:.3g}", "black", anchor=anchor)
    draw.text((width // 2, 2 + _TEXT), unit, "black", anchor="mt")
    below = np.asarray(text) / 255.0
    write_png(path, np.concatenate([shown, bar, below]), header)
