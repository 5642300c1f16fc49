"""Pictures pixel by pixel, and those that must have the same bits."""

from collections.abc import Callable, Mapping

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.core import Draw, FloatArray, Outcome, outcome
from comparisons.geometry.exact.dyadic import BoolArray


def same_bits(expected: FloatArray, found: FloatArray) -> Outcome:
    """A case a pixel; worst: the largest relative difference, inf for NaN, which always fails."""
    other = (expected != found).any(axis=-1)
    size = np.maximum(np.abs(expected), np.abs(found))
    off = np.abs(expected - found) / np.where(size > 0.0, size, 1.0)
    off = np.where(np.isnan(off), np.inf, off)
    return of_pixels(other, {"expected": expected, "found": found}, float(off.max()))


def of_pixels(wrong: BoolArray, pictures: Mapping[str, FloatArray], worst: float) -> Outcome:
    """wrong (height, width): a case a pixel;  pictures: (height, width, c), of which the examples
    show the pixels."""
    y, x = (index.ravel() for index in np.indices(wrong.shape))
    columns = {name: pixels.reshape(wrong.size, -1) for name, pixels in pictures.items()}
    return outcome(wrong.ravel(), {"pixel": np.column_stack([x, y]), **columns}, worst=worst)


MAKES = (scenes.path, scenes.whitted)


def over(draw: Draw, pair: Callable[[rt.Scene, str], tuple[FloatArray, FloatArray]]) -> Outcome:
    """Of both scenes;  pair(scene, its name): two pictures that must be the same."""
    pairs = (pair(make(draw.folder), make.__name__) for make in MAKES)
    return sum((same_bits(*pictures) for pictures in pairs), Outcome(0, 0))


def on_threads(scene: rt.Scene, threads: int = 1) -> FloatArray:
    """The picture."""
    return rt.render(scene, threads=threads).colour
