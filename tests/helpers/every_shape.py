"""Every type of shape, turned, sheared and mirrored."""

from typing import Any

import numpy as np

from reference_rt.core import transform
from reference_rt.core.model import types_of
from reference_rt.scene.examples import examples
from reference_rt.shapes.csg import AnyShape


def every_shape(number: int) -> list[Any]:
    """One example of each type, by its number."""
    return [examples(of)[number] for of in types_of(AnyShape)]


def tilted(rng: np.random.Generator, k: int, mirrored: bool) -> tuple:
    """A map that turns, shears, stretches and, or not, mirrors; each somewhere else."""
    axis = rng.normal(size=3)
    turn = transform.Rotate(
        rotate=transform.Turn(axis=tuple(axis), degrees=float(rng.uniform(0, 360)))
    )
    linear = np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3))
    if mirrored:
        linear[:, 0] *= -1.0
    matrix = np.column_stack([linear, 2.5 * np.array([k % 4, k // 4 % 4, 0.3 * k])])
    rows = tuple(tuple(map(float, row)) for row in matrix)
    return turn, transform.Matrix(matrix=rows)
