"""Every kind of shape, turned, sheared and mirrored."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from builders import icosphere, write_obj

import reference_rt as rt
from reference_rt.core import transform

STAR = [[0.0, 1.0], [0.6, -0.8], [-1.0, 0.3], [1.0, 0.3], [-0.6, -0.8]]
QUADRIC = {
    "coefficients": (1.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1),
    "lower": (-0.9, -0.8, -0.7),
    "upper": (0.8, 0.9, 1.0),
}
GROUPS = {"pair": (rt.Sphere(radius=0.8), rt.Sphere(radius=0.3, center=(0.2, 0.9, 0.1)))}


def kinds(folder: Path) -> list[Callable[..., object]]:
    """Each makes a shape, given a transform."""
    file = write_obj(folder / "ball.obj", *icosphere(1))
    return [
        lambda **at: rt.Sphere(radius=0.8, **at),
        rt.Box,
        rt.Rectangle,
        rt.Disk,
        rt.Plane,
        lambda **at: rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(0, 1, 0), **at),
        lambda **at: rt.Polygon(rings=(STAR,), **at),
        lambda **at: rt.Mesh(file=str(file), **at),
        lambda **at: rt.Cylinder(radius=0.5, capped=False, **at),
        lambda **at: rt.Cone(radius=0.6, **at),
        lambda **at: rt.Torus(major_radius=0.7, minor_radius=0.3, **at),
        lambda **at: rt.Quadric(**QUADRIC, **at),
        lambda **at: rt.Quadric(**QUADRIC, capped=True, **at),
        lambda **at: rt.Difference(of=(rt.Box(), rt.Sphere(radius=1.2)), **at),
        lambda **at: rt.Instance(group="pair", **at),
    ]


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
