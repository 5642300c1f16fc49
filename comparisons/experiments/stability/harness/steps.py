"""Steps of transforms, in short."""

from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.geometry.affine import unit_vectors
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate, Turn


def vector(v: Any) -> tuple[float, float, float]:
    """Three numbers of any kind as floats."""
    x, y, z = np.asarray(v, np.float64).tolist()
    return x, y, z


def at(x: float, y: float, z: float) -> Translate:
    return Translate(translate=(x, y, z))


def scaled(*factors: float) -> Scale:
    """By three factors, or by one in all directions."""
    x, y, z = factors * 3 if len(factors) == 1 else factors
    return Scale(scale=(x, y, z))


def turned(degrees: float, axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Rotate:
    return Rotate(rotate=Turn(axis=axis, degrees=degrees))


def any_turn(rng: np.random.Generator) -> Rotate:
    """By any angle about any axis."""
    axis = vector(unit_vectors(rng, 1)[0])
    return turned(float(rng.uniform(0.0, 360.0)), axis)


def matrix(linear: FloatArray, center: FloatArray) -> tuple[Matrix]:
    """The one step p -> linear p + center."""
    x, y, z = (tuple(row) for row in np.column_stack([linear, center]).tolist())
    return (Matrix(matrix=(x, y, z)),)


def orthogonal(rng: np.random.Generator) -> FloatArray:
    """(3, 3), any: of normal numbers, so that it is spread evenly up to the signs of columns."""
    return np.asarray(np.linalg.qr(rng.normal(size=(3, 3)))[0])


def turning(rng: np.random.Generator) -> FloatArray:
    """The same without mirroring."""
    q = orthogonal(rng)
    return np.asarray(q * np.sign(np.linalg.det(q)))
