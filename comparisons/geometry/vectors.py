"""Random and unit vectors for the rays and shapes of the experiments."""

import numpy as np

from reference_rt.core.arrays import FloatArray


def unit_vectors(rng: np.random.Generator, n: int) -> FloatArray:
    """(n, 3), uniformly distributed on the sphere."""
    v = rng.normal(size=(n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def across(rng: np.random.Generator, v: FloatArray) -> FloatArray:
    """Random unit vectors (n, 3) perpendicular to the vectors v (n, 3)."""
    return unit_rows(np.cross(v, unit_vectors(rng, len(v))))


def unit_rows(v: FloatArray) -> FloatArray:
    """v (..., 3), normalised."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
