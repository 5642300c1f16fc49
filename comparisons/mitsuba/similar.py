"""Whether a map is a similarity, to rounding: as `reference_rt.shapes.Sphere` decides it."""

import numpy as np

from reference_rt.core.arrays import FloatArray

TOLERANCE = 8e-16 * 4
"""Relative: each entry of the product of three columns rounds at most 8 times."""


def is_similarity(linear: FloatArray) -> bool:
    """Whether a map (3, 3) scales all lengths alike."""
    scaled = linear / np.abs(linear).max()
    gram = scaled.T @ scaled
    factor = np.trace(gram) / 3.0
    return bool(np.abs(gram - factor * np.eye(3)).max() <= TOLERANCE * factor)
