"""`Picture`: a rendered scene, its layers, and how it is saved and shown."""

import base64
import importlib.metadata
import io
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.image import check_suffix, display, eight_bits, write
from reference_rt.scene.model import SceneModel
from reference_rt.util.errors import Brief

BRIGHT = 99.0
"""The percentile of the brightest channel that a notebook shows as white: lamps may be brighter."""


class Taken(NamedTuple):
    """The samples of a picture.  fewest, most: of a pixel;  wanted: of every pixel of the whole
    picture;  error: an estimate of the relative standard error (see `noise`), None if there is
    none."""

    fewest: int
    most: int
    wanted: int
    error: float | None = None

    @property
    def partial(self) -> str:
        """How many there are, if there are fewer than wanted; else ""."""
        if self.fewest >= self.wanted:
            return ""
        count = f"{self.fewest} to {self.most}" if self.most > self.fewest else f"{self.most}"
        return f"{count} of {self.wanted} samples per pixel"


@dataclass(frozen=True)
class Picture(metaclass=Brief):
    """A rendered scene.

    layers: float64 arrays by name.  "colour" (height, width, 3) is linear radiance; the others are
    those of `Film.layers`: albedo, normal, position and variance (height, width, 3), depth, id,
    bvh_steps and intersections (height, width).  Ray casting always has colour and normal (height,
    width, 3), distance and id (height, width), uv (height, width, 2).  shown: the layer that is the
    picture.  seconds: wall-clock time of "tables" (files, arrays, hierarchy), "compile" (or loading
    cached kernels) and "render".  scene: what was rendered, and taken: with which samples; None if
    that is unknown.
    """

    layers: dict[str, FloatArray]
    shown: str = "colour"
    seconds: dict[str, float] = field(default_factory=dict)
    scene: SceneModel | None = None
    taken: Taken | None = None

    @property
    def colour(self) -> FloatArray:
        """(height, width, 3), row 0 on top."""
        return self.layers["colour"]

    @property
    def nonfinite_pixels(self) -> IntArray:
        """(n, 2) column and row, along rows, of the pixels that have a NaN or a value beyond the
        range of float32 (the files' format) in any layer but depth and distance, which are inf for
        a miss."""
        most = np.finfo(np.float32).max
        bad = np.zeros(self.colour.shape[:2], np.bool_)
        for name, layer in self.layers.items():
            if name not in ("depth", "distance"):
                bad |= ~(np.abs(layer.reshape(*bad.shape, -1)) <= most).all(axis=-1)
        return np.argwhere(bad)[:, ::-1]

    @property
    def nonfinite(self) -> int:
        """The number of `nonfinite_pixels`."""
        return len(self.nonfinite_pixels)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all layers to an .exr (float32), or the shown layer to a .png (8-bit sRGB), with
        the provenance in the header.  The file appears whole or not at all.  Raises UsageError for
        other suffixes, ImageError for what cannot be written."""
        target = Path(path)
        check_suffix(target)
        write(target, self, header_of(self.scene, self.taken))

    def show(self, exposure: float | None = None) -> None:
        """Open the shown layer in the system's image viewer.  exposure: see `png`."""
        from PIL import Image

        Image.open(io.BytesIO(self.png(exposure=exposure))).show()

    def png(self, layer: str = "", exposure: float | None = None) -> bytes:
        """A layer, by default the shown one, as a PNG file in memory.

        exposure: a factor of radiance before sRGB encoding; None: as much as makes the 99th
        percentile of the brightest channel white, if that is above 1 or below 1/4.
        """
        from PIL import Image

        name = layer or self.shown
        values = self.layers[name]
        if name in _RADIANCE:
            values = values * (_exposure(values) if exposure is None else exposure)
        file = io.BytesIO()
        Image.fromarray(eight_bits(display(Picture({name: values}, name)))).save(file, "PNG")
        return file.getvalue()

    def __repr__(self) -> str:
        height, width = self.colour.shape[:2]
        seconds = self.seconds.get("render")
        time = "" if seconds is None else f", {seconds:.2f} s to render"
        return f"<Picture {width} x {height}: {', '.join(self.layers)}{time}>"

    def _repr_png_(self) -> bytes:
        return self.png()

    def _repr_html_(self) -> str:
        """All layers, for notebooks: the shown one large, and what was done to display it."""
        exposure = _exposure(self.layers[self.shown]) if self.shown in _RADIANCE else 1.0
        note = "" if exposure == 1.0 else f", shown at exposure {exposure:.3g}"
        rest = [name for name in self.layers if name != self.shown]
        others = "".join(
            f'<figure style="display:inline-block;margin:4px">{_image(self.png(name), 120)}'
            f"<figcaption>{name}</figcaption></figure>"
            for name in rest
        )
        text = repr(self).strip("<>") + note
        return f"<div>{_image(self.png(), 480)}<div>{text}</div>{others}</div>"


def provenance(scene: SceneModel) -> dict[str, str]:
    """The provenance of a picture, for its header: the same scene has the same bytes."""
    return {
        "software": f"reference_rt {importlib.metadata.version('reference-rt')}",
        "scene": scene.name,
        "sceneSha256": scene.digest(),
        "integrator": scene.integrator.model_dump_json(),
        "sampler": scene.resolved_sampler.model_dump_json(),
        "filter": scene.film.filter.model_dump_json(),
    }


def header_of(scene: SceneModel | None, taken: Taken | None) -> dict[str, str]:
    """The provenance in the header of a picture's file, and that it is partial if it is."""
    header = {} if scene is None else provenance(scene)
    if taken is not None and taken.partial:
        header["partial"] = taken.partial
    return header


MOST_PLACES = 4


class Written(NamedTuple):
    """What was found while a picture was written.  nonfinite: how many pixels are not finite;
    places: (column, row) of the first of them;  black: whether all of the shown layer is black."""

    nonfinite: int
    places: tuple[tuple[int, int], ...]
    black: bool


def written(picture: Picture, first_row: int = 0) -> Written:
    """The same of a picture, or of some rows of one."""
    bad = picture.nonfinite_pixels
    places = tuple((int(x), int(y) + first_row) for x, y in bad[:MOST_PLACES])
    return Written(len(bad), places, not picture.layers[picture.shown].any())


_RADIANCE = ("colour", "variance")
"""Layers without an upper limit."""


def _exposure(values: FloatArray) -> float:
    """See `Picture.png`."""
    brightest = values.max(axis=-1)
    finite = brightest[np.isfinite(brightest)]
    level = float(np.percentile(finite, BRIGHT)) if finite.size else 0.0
    return 1.0 if 0.25 <= level <= 1.0 or level <= 0.0 else 1.0 / level


def _image(png: bytes, width: int) -> str:
    """An HTML image of at most this width."""
    data = base64.b64encode(png).decode()
    return f'<img style="max-width:{width}px" src="data:image/png;base64,{data}">'
