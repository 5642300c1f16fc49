"""Pictures that must have the same bits, and the scenes of F14."""

from collections.abc import Callable

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.family import EXAMPLES, Draw, FloatArray, Outcome


def same_bits(expected: FloatArray, found: FloatArray) -> Outcome:
    """A case a pixel; worst: the largest relative difference, inf for NaN, which always fails."""
    other = (expected != found).any(axis=-1)
    size = np.maximum(np.abs(expected), np.abs(found))
    off = np.abs(expected - found) / np.where(size > 0.0, size, 1.0)
    off = np.where(np.isnan(off), np.inf, off)
    examples = tuple(
        {
            "pixel": [int(x), int(y)],
            "expected": [c.hex() for c in expected[y, x].tolist()],
            "found": [c.hex() for c in found[y, x].tolist()],
        }
        for y, x in np.argwhere(other)[:EXAMPLES]
    )
    return Outcome(other.size, int(np.count_nonzero(other)), float(off.max()), 0, examples)


MAKES = (scenes.path, scenes.whitted)


def over(draw: Draw, again: Callable[[rt.Scene], FloatArray]) -> Outcome:
    """Both scenes on one thread, against what `again` renders of them."""
    total = Outcome(0, 0)
    for make in MAKES:
        scene = make(draw.folder)
        total += same_bits(rt.render(scene, threads=1).colour, again(scene))
    return total
