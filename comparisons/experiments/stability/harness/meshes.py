"""Closed meshes, and rays that must meet them."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.assets import files
from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.geometry.affine import unit_vectors
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.files import ply
from reference_rt.core.arrays import IntArray
from reference_rt.shapes.meshes.files import MeshData

AWAY = np.array([148376.0, 1234.0, -223423.0]) / 148376.0
"""Where Embree's own test puts its meshes, of an offset of 1."""

STRAY = 0.1
"""How far from the middle rays start."""


@dataclass(frozen=True)
class Closed:
    """vertices (n, 3), faces (m, 3), counter-clockwise from outside.  Every ray from `insides`
    (k, 3), or from STRAY around them, must leave it; nothing is further than 6 from the origin."""

    name: str
    vertices: FloatArray
    faces: IntArray
    insides: FloatArray

    @property
    def stray(self) -> float:
        return STRAY if len(self.insides) == 1 else 0.0

    def moved(self, by: FloatArray, scale: float = 1.0) -> "Closed":
        """Scaled, then moved; vertices are rounded, and it stays closed as faces share them."""
        return Closed(self.name, self.vertices * scale + by, self.faces, self.insides * scale + by)


def _closed(name: str, vertices: FloatArray, faces: IntArray) -> Closed:
    return Closed(name, vertices, faces, np.zeros((1, 3)))


def ball(subdivisions: int, radius: float = 2.0) -> Closed:
    """An icosphere of 20 * 4^subdivisions triangles; Embree's test has a sphere of radius 2."""
    from trimesh.creation import icosphere

    mesh = icosphere(subdivisions=subdivisions)
    return _closed("ball", radius * np.array(mesh.vertices), np.array(mesh.faces))


def noisy(rng: np.random.Generator, around: int = 16) -> Closed:
    """A globe of `around` meridians and as many circles of latitude, whose vertices stand at random
    distances of 1 to 6 (pbrt-v4, shapes_test.cpp: Triangle, Watertight)."""
    theta = np.pi * np.arange(1, around) / around
    phi = 2.0 * np.pi * np.arange(around) / around
    rings = np.stack(
        [
            np.sin(theta)[:, None] * np.cos(phi),
            np.sin(theta)[:, None] * np.sin(phi),
            np.repeat(np.cos(theta)[:, None], around, axis=1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    poles = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    vertices = np.concatenate([rings, poles])
    top, bottom = len(rings), len(rings) + 1
    faces = []
    for j in range(around):
        k = (j + 1) % around
        faces += [[top, j, k], [bottom, len(rings) - around + k, len(rings) - around + j]]
        for i in range(0, len(rings) - around, around):
            faces += [[i + j, i + around + j, i + around + k], [i + j, i + around + k, i + k]]
    return _closed(
        "noisy globe", vertices * rng.uniform(1.0, 6.0, (len(vertices), 1)), np.array(faces)
    )


def cube(n: int) -> Closed:
    """[-1, 1]^3, each face n x n squares of two triangles each."""
    ticks = np.arange(n + 1)
    i, j = (x.ravel() for x in np.meshgrid(ticks[:-1], ticks[:-1], indexing="ij"))
    corners: list[Any] = []
    quads: list[Any] = []
    for axis in range(3):
        for side in (0, n):
            grid = np.empty((n + 1, n + 1, 3), np.int64)
            grid[..., axis] = side
            grid[..., (axis + 1) % 3], grid[..., (axis + 2) % 3] = ticks[:, None], ticks[None, :]
            first = len(corners) * (n + 1) ** 2
            a, b = first + i * (n + 1) + j, first + (i + 1) * (n + 1) + j
            two = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
            quads.append(two if side else two[:, ::-1])
            corners.append(grid.reshape(-1, 3))
    # Neighbouring faces share the vertices of their edges.
    unique, number = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    return _closed("cube", unique * 2.0 / n - 1.0, number.ravel()[np.concatenate(quads)])


def knot(along: int = 120, around: int = 10, tube: float = 0.15) -> Closed:
    """A tube along the (2, 3) torus knot of radii 1 and 0.4, rays starting on its middle line."""
    s = np.linspace(0.0, 2.0 * math.pi, along, endpoint=False)
    r = 1.0 + 0.4 * np.cos(3 * s)
    line = np.stack([r * np.cos(2 * s), r * np.sin(2 * s), 0.4 * np.sin(3 * s)], axis=1)
    tangent = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The torus' own outward direction makes a frame that closes.
    out = np.stack(
        [np.cos(2 * s) * np.cos(3 * s), np.sin(2 * s) * np.cos(3 * s), np.sin(3 * s)], axis=1
    )
    out -= np.sum(out * tangent, axis=1, keepdims=True) * tangent
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    side = np.cross(tangent, out)
    a = np.linspace(0.0, 2.0 * math.pi, around, endpoint=False)[None, :, None]
    ring = line[:, None] + tube * (np.cos(a) * out[:, None] + np.sin(a) * side[:, None])
    i, j = (x.ravel() for x in np.meshgrid(np.arange(along), np.arange(around), indexing="ij"))
    i2, j2 = (i + 1) % along, (j + 1) % around
    c00, c10, c01, c11 = i * around + j, i2 * around + j, i * around + j2, i2 * around + j2
    faces = np.concatenate([np.stack([c00, c11, c10], 1), np.stack([c00, c01, c11], 1)])
    return Closed("knot", ring.reshape(-1, 3), faces, line)


def edges(mesh: Closed) -> IntArray:
    """Pairs of vertices (k, 2), each edge once."""
    pairs = np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def targets(rng: np.random.Generator, mesh: Closed, n: int) -> FloatArray:
    """Points (at least n, 3): every vertex, every edge's middle, and random points of edges."""
    ends = mesh.vertices[edges(mesh)]
    middles = 0.5 * ends[:, 0] + 0.5 * ends[:, 1]
    known = np.concatenate([mesh.vertices, middles])
    pick = ends[rng.integers(0, len(ends), max(0, n - len(known)))]
    share = rng.uniform(0.0, 1.0, (len(pick), 1))
    return np.concatenate([known, (1.0 - share) * pick[:, 0] + share * pick[:, 1]])


def starts(rng: np.random.Generator, mesh: Closed, n: int, scale: float = 1.0) -> FloatArray:
    """Points (n, 3) inside."""
    inside = mesh.insides[rng.integers(0, len(mesh.insides), n)]
    return inside + mesh.stray * scale * rng.uniform(-1.0, 1.0, (n, 3)) / math.sqrt(3.0)


def from_inside(
    rng: np.random.Generator, mesh: Closed, n: int, scale: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """n rays anywhere, and n or more at vertices and edges."""
    at = targets(rng, mesh, n)
    o = starts(rng, mesh, n + len(at), scale)
    d = np.concatenate([unit_vectors(rng, n) * scale, at - o[n:]])
    return o, d


def write(vertices: FloatArray, faces: IntArray, file: Path) -> Path:
    """Vertices (n, 3) and triangles (m, 3) as .ply, with every bit of the vertices."""
    file.write_bytes(ply(MeshData(vertices, faces)))
    return file


def write_obj(file: Path, vertices: FloatArray, faces: Any) -> None:
    """The same as .obj."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def mitsuba_mesh(vertices: FloatArray, faces: IntArray) -> Any:
    """Of Mitsuba, vertices rounded to float32."""
    mi = mitsuba()
    mesh = mi.Mesh("mesh", len(vertices), len(faces))
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.astype(np.float32).ravel()
    values["faces"] = faces.astype(np.uint32).ravel()
    values.update()
    return mesh


BALL = "ball.obj"
"""The mesh file of scenes with solids: each has one of this name."""


def write_smallest_ball(folder: Path) -> None:
    """BALL of twenty triangles."""
    (folder / BALL).write_bytes(files()[BALL])
