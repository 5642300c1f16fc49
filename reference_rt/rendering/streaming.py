"""Pictures that are larger than memory: how much of one is kept there, and how it is written."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import EXR_ROWS, exr_rows
from reference_rt.rendering.accumulation import layers_of
from reference_rt.rendering.checkpoint import Checkpoint
from reference_rt.rendering.framebuffer import Framebuffer
from reference_rt.rendering.image import channels
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.units import BAND
from reference_rt.scene.build import BuiltScene
from reference_rt.util.errors import ImageError, UsageError
from reference_rt.util.memory import resident_memory

_FEWEST_BANDS = 8
"""Bands that are in memory at least: two that are computed, and others that are being read and
written, each with a copy as the bytes of its file."""

_MOST_PLACES = 4

_OTHER = 96 << 20
"""Bytes for all else that a render needs: units that are computed, pages of libraries that have not
been used yet, rows that are being written."""

_SHARE = 0.9
"""The part of the memory that is given away: some of what is freed does not go back to the system.
32768 x 32768 pixels took 1.07 times the 2 GiB that they might when all of it was given away."""


def check_fits(
    scene: BuiltScene, widths: Mapping[str, int], memory: int | None, store: Checkpoint | None
) -> int | None:
    """The bytes of a picture's sums that may be in memory at a time, None for all of them.

    memory: bytes that this process may take, None for no limit.  Raises UsageError where that is
    too little, ImageError where the disk has too little room for what is not in memory.
    """
    if memory is None:
        return None
    size = scene.film.width * scene.film.height * 8 * sum(widths.values())
    used = resident_memory() or 0
    free = int(_SHARE * memory) - used - _OTHER
    if 3 * size <= free:  # sums, layers, and float32 with what the library makes of them
        return None
    band = BAND * 8 * sum(widths.values())
    if free < _FEWEST_BANDS * band:
        least = (used + _OTHER + _FEWEST_BANDS * band) / _SHARE
        raise UsageError(
            f"--memory: the scene and the program take {used / 2**20:.0f} MiB already; expected at "
            f"least {least / 2**20:.0f} MiB"
        )
    if store is None:
        raise UsageError(
            "--memory: the picture does not fit, and there is no checkpoint that takes the rest; "
            "expected --checkpoint"
        )
    folder = next(parent for parent in store.folder.parents if parent.exists())
    room = shutil.disk_usage(folder).free
    if size > room and not store.exists():
        raise ImageError(
            f"{folder}: has {room / 2**30:.1f} GiB of free space; expected the "
            f"{size / 2**30:.1f} GiB of the picture's samples"
        )
    return free // 2


class Written(NamedTuple):
    """What was found while a picture was written.  nonfinite: how many pixels are not finite;
    places: (column, row) of the first of them;  black: whether all of the shown layer is black."""

    nonfinite: int
    places: tuple[tuple[int, int], ...]
    black: bool


def written(picture: Picture, first_row: int = 0) -> Written:
    """The same of a picture, or of some rows of one."""
    bad = picture.nonfinite_pixels
    places = tuple((int(x), int(y) + first_row) for x, y in bad[:_MOST_PLACES])
    return Written(len(bad), places, not picture.layers[picture.shown].any())


def write_in_parts(
    path: Path, scene: BuiltScene, frame: Framebuffer, shown: str, header: Mapping[str, str]
) -> Written:
    """Write a picture to an .exr file, some rows at a time.  Raises ImageError."""
    film = scene.film
    nothing = {name: np.zeros((0, width)) for name, width in frame.widths.items()}
    names = [*channels(_rows_of(layers_of(scene, nothing, 1), film.width))]
    total = Written(0, (), True)
    with exr_rows(path, (film.width, film.height), names, header) as put:
        for pixels, sums, samples in frame.slices(film.width * EXR_ROWS):
            layers = _rows_of(layers_of(scene, sums, samples), film.width)
            put(channels(layers))
            part = written(Picture(layers, shown), pixels.start // film.width)
            total = Written(
                total.nonfinite + part.nonfinite,
                (total.places + part.places)[:_MOST_PLACES],
                total.black and part.black,
            )
    return total


def _rows_of(layers: Mapping[str, FloatArray], width: int) -> dict[str, FloatArray]:
    """Layers (n, ...) as rows of pixels."""
    return {
        name: layer.reshape(len(layer) // width, width, *layer.shape[1:])
        for name, layer in layers.items()
    }
