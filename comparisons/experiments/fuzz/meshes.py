"""Meshes, whole and with the damage that files have and that readers accept."""

from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.data import Data
from comparisons.experiments.fuzz.fields import DIGITS, Draw
from reference_rt.core.arrays import FloatArray, IntArray

Surface = tuple[FloatArray, IntArray]
"""Vertices (n, 3) and faces (m, 3)."""


def mesh(draw: Draw, closed: bool = False) -> Data:
    """A mesh's fields.  closed: one that can be an operand of a solid."""
    vertices, faces = draw.pick(CLOSED if closed else (*CLOSED, *OPEN))(draw)
    if not closed and draw.chance(0.35):
        vertices, faces = draw.pick(DAMAGES)(draw, vertices, faces)
    found: Data = {"type": "mesh", "vertices": _rows(vertices), "faces": faces.tolist()}
    n = len(vertices)
    if closed:
        return found
    if draw.chance(0.3):
        found["uv"] = _rows(draw.rng.uniform(0.0, 2.0, (n, 2)))
    if draw.chance(0.3):
        found["colours"] = _rows(draw.rng.uniform(0.0, 1.0, (n, 3)))
    if draw.chance(0.2):
        outward = vertices - vertices.mean(axis=0) + 0.1 * draw.rng.normal(size=(n, 3))
        found["normals"] = _rows(outward)
    elif draw.chance(0.3):
        found["smooth"] = True
    if "smooth" not in found and draw.chance(0.2):
        found["face_normals"] = True
    return found


def _rows(array: FloatArray) -> list[list[float]]:
    return [[float(f"{x:.{DIGITS}g}") for x in row] for row in array.tolist()]


def _ball(draw: Draw) -> Surface:
    from trimesh.creation import icosphere

    found = icosphere(subdivisions=int(draw.rng.integers(0, 2)))
    return np.array(found.vertices), np.array(found.faces)


def _tetrahedron(draw: Draw) -> Surface:
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float64)
    corners = corners * draw.rng.uniform(0.4, 1.0, (4, 1))
    return corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def _cube(_: Draw) -> Surface:
    from trimesh.creation import box

    found = box(extents=(1.5, 1.2, 1.0))
    return np.array(found.vertices), np.array(found.faces)


def _prism(draw: Draw) -> Surface:
    """A prism over a regular polygon, with a fan on either end."""
    n = int(draw.rng.integers(3, 8))
    angle = 2.0 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low, high = (np.column_stack([ring, np.full(n, z)]) for z in (-0.6, 0.6))
    faces: list[Any] = []
    for i in range(n):
        j = (i + 1) % n
        faces += [[i, j, n + j], [i, n + j, n + i]]
    faces += [[0, i + 1, i] for i in range(1, n - 1)]
    faces += [[n, n + i, n + i + 1] for i in range(1, n - 1)]
    return np.concatenate([low, high]), np.array(faces)


def _grid(draw: Draw) -> Surface:
    """A height field."""
    n = int(draw.rng.integers(1, 5))
    ticks = np.linspace(-1.0, 1.0, n + 1)
    x, y = (a.ravel() for a in np.meshgrid(ticks, ticks))
    z = draw.rng.uniform(-0.25, 0.25, len(x))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n)))
    a = j * (n + 1) + i
    b, c = a + 1, a + n + 1
    faces = np.concatenate([np.stack([a, b, c + 1], 1), np.stack([a, c + 1, c], 1)])
    return np.stack([x, y, z], axis=1), faces


def _soup(draw: Draw) -> Surface:
    """Triangles that share nothing."""
    n = int(draw.rng.integers(1, 12))
    middle = draw.rng.uniform(-0.7, 0.7, (n, 1, 3))
    corners = middle + draw.rng.uniform(-0.5, 0.5, (n, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def _strip(draw: Draw) -> Surface:
    """A band of thin triangles, twisted."""
    n = int(draw.rng.integers(3, 10))
    s = np.linspace(0.0, 1.5 * np.pi, n)
    width = 0.01 if draw.extreme else 0.3
    near = np.stack([np.cos(s), np.sin(s), 0.2 * s - 0.4], axis=1)
    far = near + width * np.stack([np.cos(2 * s), np.zeros(n), np.sin(2 * s)], axis=1)
    faces = [[k, k + 1, n + k] for k in range(n - 1)]
    faces += [[k + 1, n + k + 1, n + k] for k in range(n - 1)]
    return np.concatenate([near, far]), np.array(faces)


CLOSED: tuple[Callable[[Draw], Surface], ...] = (_ball, _tetrahedron, _cube, _prism)
OPEN: tuple[Callable[[Draw], Surface], ...] = (_grid, _soup, _strip)


def _holes(draw: Draw, vertices: FloatArray, faces: IntArray) -> Surface:
    keep = draw.rng.random(len(faces)) > 0.3
    keep[0] = True
    return vertices, faces[keep]


def _turned(draw: Draw, vertices: FloatArray, faces: IntArray) -> Surface:
    """Some triangles face the other way."""
    turned = draw.rng.random(len(faces)) < 0.4
    return vertices, np.where(turned[:, None], faces[:, ::-1], faces)


def _doubled(draw: Draw, vertices: FloatArray, faces: IntArray) -> Surface:
    """A triangle twice."""
    return vertices, np.concatenate([faces, faces[: 1 + len(faces) // 4]])


def _degenerate(draw: Draw, vertices: FloatArray, faces: IntArray) -> Surface:
    """Triangles without an area, which the reader leaves out."""
    a = int(draw.rng.integers(len(vertices)))
    b = int(draw.rng.integers(len(vertices)))
    return vertices, np.concatenate([[[a, b, b]], faces, [[a, a, a]]])


def _unused(draw: Draw, vertices: FloatArray, faces: IntArray) -> Surface:
    """Vertices that no triangle has, one of them far away."""
    extra = np.array([[50.0, 0.0, 0.0], [0.1, 0.2, 0.3]])
    return np.concatenate([extra, vertices]), faces + 2


def _needles(draw: Draw, vertices: FloatArray, faces: IntArray) -> Surface:
    """Squeezed along an axis."""
    axis = int(draw.rng.integers(3))
    squeeze = np.ones(3)
    squeeze[axis] = 1e-4 if draw.extreme else 0.03
    return vertices * squeeze, faces


DAMAGES: tuple[Callable[[Draw, FloatArray, IntArray], Surface], ...] = (
    *(_holes, _turned, _doubled, _degenerate, _unused, _needles),
)
