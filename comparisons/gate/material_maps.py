"""Pictures of what a material does in all directions wi, for people: the cosine from 1 to -1
downwards, the azimuth across."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.statistics.chi_square import SPHERE
from reference_rt.core.arrays import FloatArray
from reference_rt.util.files import replacing

GRID = (32, 64)
"""Cells down and across, of the same solid angle."""

Map = tuple[str, FloatArray]
"""A title, and values over GRID."""


def draw(maps: Sequence[Map], words: str, path: str | Path) -> None:
    """Write maps beside each other as .png or .svg; those of both signs from blue to red."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(maps), 3.4), layout="constrained")
    every = figure.subplots(1, len(maps), squeeze=False).ravel()
    for axes, (title, values) in zip(every, maps, strict=True):
        signed = bool((values < 0.0).any())
        most = float(np.abs(values[np.isfinite(values)]).max(initial=0.0)) or 1.0
        colours = {"cmap": "RdBu_r" if signed else "viridis", "vmin": -most * signed}
        place = {"extent": (0.0, 360.0, -1.0, 1.0), "aspect": "auto"}
        shown = axes.imshow(values, vmax=most, **colours, **place)
        axes.set(title=title, xlabel="azimuth of wi, degrees", ylabel="cosine of wi")
        figure.colorbar(shown, ax=axes)
    figure.suptitle(words, fontsize=8, wrap=True)
    with replacing(Path(path)) as unfinished:
        figure.savefig(unfinished, dpi=110, format=Path(path).suffix[1:])


def centres(at: FloatArray | None = None) -> FloatArray:
    """Directions of the cells of a picture, row by row;  at (cells, n, 2): where in each cell."""
    down, across = np.indices(GRID).reshape(2, -1, 1)
    y, x = (0.5, 0.5) if at is None else (at[..., 0], at[..., 1])
    z, azimuth = 1.0 - (down + y) * 2.0 / GRID[0], (across + x) * 2.0 * math.pi / GRID[1]
    return SPHERE.points(np.stack([z, azimuth], axis=-1).reshape(-1, 2))


def _cells(v: FloatArray) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The number of each direction's cell."""
    z, azimuth = SPHERE.coordinates(v).T
    down = np.clip(((1.0 - z) * 0.5 * GRID[0]).astype(int), 0, GRID[0] - 1)
    across = np.clip((azimuth * 0.5 / math.pi * GRID[1]).astype(int), 0, GRID[1] - 1)
    return np.asarray(down * GRID[1] + across)


def histograms(
    v: FloatArray, density: Callable[[FloatArray], FloatArray], draws: int
) -> tuple[Map, ...]:
    """What is drawn, what the density says of it (64 points in each cell), and the difference in
    standard deviations."""
    size = GRID[0] * GRID[1]
    counted = np.bincount(_cells(v), minlength=size)
    fine = np.random.default_rng(4).random((size, 64, 2))
    expected = density(centres(fine)).reshape(size, 64).mean(axis=1) * 4.0 * math.pi / size * draws
    apart = (counted - expected) / np.sqrt(np.maximum(expected, 1.0))
    titles = ("drawn", "by the density", "difference, standard deviations")
    return tuple(
        (title, values.astype(float).reshape(GRID))
        for title, values in zip(titles, (counted, expected, apart), strict=True)
    )


def means(v: FloatArray, *shown: Map) -> tuple[Map, ...]:
    """Means over the cells of what belongs to directions."""
    cells, size = _cells(v), GRID[0] * GRID[1]
    counted = np.maximum(np.bincount(cells, minlength=size), 1)
    return tuple(
        (title, (np.bincount(cells, values, minlength=size) / counted).reshape(GRID))
        for title, values in shown
    )
