"""A generated mesh of any number of triangles, and writers of mesh files."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.util.files import replacing

BUNNY = 69_451
"""Triangles of the Stanford bunny, a common benchmark."""

MILLION = 1_000_000


class Blob(NamedTuple):
    """vertices (n, 3), faces (m, 3), counter-clockwise seen from outside."""

    vertices: FloatArray
    faces: IntArray


def blob(triangles: int) -> Blob:
    """A sphere with bumps that occlude each other, of at least this many triangles: the six faces
    of a cube as grids, projected to the sphere."""
    n = int(np.ceil(np.sqrt(triangles / 12)))
    u, v = np.meshgrid(*(2 * [np.linspace(-1.0, 1.0, n + 1)]), indexing="ij")
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    c00, c10 = i * (n + 1) + j, (i + 1) * (n + 1) + j
    grid = np.stack([c00, c10, c10 + 1, c00, c10 + 1, c00 + 1], axis=-1).reshape(-1, 3)
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            corners = np.stack([np.full_like(u, sign), u, sign * v], axis=-1)
            sides.append(np.roll(corners, axis, axis=-1).reshape(-1, 3))
    cube = np.concatenate(sides)
    sphere = cube / np.linalg.norm(cube, axis=1, keepdims=True)
    x, y, z = sphere.T
    bumps = np.sin(7.0 * x + 1.0) * np.sin(6.0 * y + 2.0) * np.sin(8.0 * z + 3.0)
    ripples = np.sin(41.0 * x) * np.sin(37.0 * y) * np.sin(43.0 * z)
    radius = 1.0 + 0.35 * bumps + 0.03 * ripples
    faces = np.concatenate([grid + k * (n + 1) ** 2 for k in range(6)])
    return Blob(sphere * radius[:, None], faces)


def write_ply(path: Path, mesh: Blob) -> None:
    """A binary .ply file of float32 positions and int32 indices."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(mesh.vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(mesh.faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(mesh.faces), np.dtype([("n", "u1"), ("corners", "<i4", 3)]))
    rows["n"], rows["corners"] = 3, mesh.faces
    with replacing(path) as temporary:
        temporary.write_bytes(
            header.encode() + mesh.vertices.astype("<f4").tobytes() + rows.tobytes()
        )


def write_obj(path: Path, mesh: Blob) -> None:
    """A text file of the same positions, with the nine digits that identify a float32."""
    with replacing(path) as temporary, temporary.open("w", encoding="ascii") as file:
        np.savetxt(file, mesh.vertices.astype("<f4"), fmt="v %.9g %.9g %.9g")
        np.savetxt(file, mesh.faces + 1, fmt="f %d %d %d")
