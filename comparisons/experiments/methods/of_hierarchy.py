"""Acceleration structures: over triangles scattered in a cube, in clusters, and needles."""

import time
from pathlib import Path
from typing import get_args

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.setting import Draw, Family, Trial, Truth, powers
from comparisons.experiments.methods.vectors import unit_vectors
from comparisons.geometry.exact import first_hit
from comparisons.geometry.exact.crossings import IntArray
from comparisons.geometry.exact.dyadic import NEVER, BoolArray
from comparisons.geometry.exact.referee import MARGIN
from reference_rt.accel import bvh
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import SceneParameters

AS_FAST = 5e3
"""Triangles up to which the full number of rays is checked by exact arithmetic; with more, as many
ray-triangle pairs are checked.  Floats find the few pairs that may meet, in 0.1 to 0.6 µs a pair.
"""

LEAST = 64
"""Rays that are checked in any case."""

AT_ONCE = 5e5
"""Ray-triangle pairs in memory at once, at up to 500 bytes each."""


def exact(parameters: SceneParameters, o: FloatArray, d: FloatArray) -> Truth:
    """The first hit over all triangles; those that a ray clearly misses in floats are skipped."""
    v = _vertices(parameters)
    ray, triangle = _near(v, o, d)
    hit = first_hit("triangles", {"vertices": v[triangle].reshape(-1, 9)}, o[ray], d[ray])
    t = np.full(len(o), NEVER, dtype=object)
    np.minimum.at(t, ray, hit.fixed)
    touching = np.zeros(len(o), bool)
    np.logical_or.at(touching, ray, hit.touching)
    return Truth(t, touching)


def _vertices(parameters: SceneParameters) -> FloatArray:
    triangles = parameters.scene.tables.geometry.shapes.triangles
    assert triangles is not None
    return triangles.vertices.reshape(-1, 3, 3)


def _clearly_beside(corners: FloatArray, d: FloatArray) -> BoolArray:
    """Whether rays from the origin along d miss triangles of corners (n, 3, 3): the signed volumes
    that ray and edges span have both signs, by more than a thousand times their rounding error."""
    after = np.roll(corners, -1, axis=1)
    volumes = np.einsum("nij,nj->ni", np.cross(corners, after), d)
    size = np.linalg.norm(corners, axis=2) * np.linalg.norm(after, axis=2)
    slack = 1e-13 * size * np.linalg.norm(d, axis=1)[:, None]
    return np.asarray((volumes > slack).any(axis=1) & (volumes < -slack).any(axis=1))


def _near(v: FloatArray, o: FloatArray, d: FloatArray) -> tuple[IntArray, IntArray]:
    """(ray, triangle) indices of all pairs that may meet."""
    middle = v.mean(axis=1)
    radius = np.linalg.norm(v - middle[:, None], axis=2).max(axis=1)
    reach = radius + MARGIN * (np.abs(v).max() + np.abs(o).max())
    unit = d / np.linalg.norm(d, axis=1, keepdims=True)
    found, step = [], max(int(AT_ONCE / len(v)), 1)
    for begin in range(0, len(o), step):
        rays = slice(begin, begin + step)
        # Bounding spheres first.  By the cross product, because the difference of squares
        # |c - o|² - (u·(c - o))² cancels.
        off = np.cross(middle[None] - o[rays, None], unit[rays, None])
        ray, triangle = np.nonzero(np.einsum("ijk,ijk->ij", off, off) <= reach**2)
        ray += begin
        beside = _clearly_beside(v[triangle] - o[ray, None], d[ray])
        found.append((ray[~beside], triangle[~beside]))
    ray, triangle = (np.concatenate(part) for part in zip(*found, strict=True))
    return ray, triangle


def _checked(number: float, wanted: int) -> int:
    return max(int(wanted * min(1.0, AS_FAST / number)), LEAST)


def build(method: str, parameters: SceneParameters) -> float:
    """Seconds, the best of three: other load on the machine only adds to it."""
    v = _vertices(parameters)
    bounds, corners = (v.min(axis=1), v.max(axis=1)), v.reshape(-1, 9)
    kind = next(k for k in get_args(bvh.Method) if method == f"hierarchy.{k}")
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        bvh.build(*bounds, kind, corners)
        times.append(time.perf_counter() - begin)
    return min(times)


HIERARCHY = Family("hierarchy", exact, checked=_checked, build=build)


def _write_ply(path: Path, v: FloatArray) -> None:
    """Write triangles (n, 3, 3) as float64, so that the renderer reads them without rounding."""
    n = len(v)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * n}\nproperty double x\n"
        f"property double y\nproperty double z\nelement face {n}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    faces = np.zeros(n, dtype=[("size", "u1"), ("corners", "<i4", 3)])
    faces["size"], faces["corners"] = 3, np.arange(3 * n).reshape(n, 3)
    path.write_bytes(header.encode() + v.astype("<f8").tobytes() + faces.tobytes())


def _trial(draw: Draw, v: FloatArray) -> list[Trial]:
    """Rays from all around at points among the triangles, anywhere in the cube [-1, 1]³."""
    path = draw.folder / f"{len(v)}.ply"
    _write_ply(path, v)
    scene = rt.Scene(shapes=(rt.Mesh(file=str(path)),))
    o = 3.0 * unit_vectors(draw.rng, draw.rays)
    d = draw.rng.uniform(-1.0, 1.0, (draw.rays, 3)) - o
    return [Trial((SceneParameters(scene),), o, d, 2.0)]


def _triangles(draw: Draw, centers: FloatArray, sizes: FloatArray) -> FloatArray:
    """(n, 3, 3): corners on spheres of these sizes around the centres."""
    n = len(centers)
    corners = unit_vectors(draw.rng, 3 * n).reshape(n, 3, 3)
    return np.asarray(centers[:, None] + sizes.reshape(-1, 1, 1) * corners)


@HIERARCHY.sweep("strewn", "triangles", powers(1, 2, 3, 4, 5), extreme=1e4)
def strewn(draw: Draw, number: float) -> list[Trial]:
    """Triangles scattered in a cube, smaller the more there are; rays from all around into it."""
    n = int(number)
    sizes = np.full(n, 0.5 * number ** (-1.0 / 3.0))
    return _trial(draw, _triangles(draw, draw.rng.uniform(-1.0, 1.0, (n, 3)), sizes))


@HIERARCHY.sweep("clustered", "triangles", powers(1, 2, 3, 4, 5), extreme=1e4)
def clustered(draw: Draw, number: float) -> list[Trial]:
    """Nine triangles in ten in ten small clusters, each a hundredth as wide as the cube; the same
    rays, most of which miss."""
    n = int(number)
    middles = draw.rng.uniform(-0.9, 0.9, (10, 3))
    centers = middles[draw.rng.integers(0, 10, n)] + 0.02 * draw.rng.normal(size=(n, 3))
    apart = draw.rng.uniform(size=n) < 0.1
    centers[apart] = draw.rng.uniform(-1.0, 1.0, (int(apart.sum()), 3))
    scale = 0.5 * number ** (-1.0 / 3.0)
    return _trial(draw, _triangles(draw, centers, np.where(apart, scale, 0.04 * scale)))


@HIERARCHY.sweep("needles", "triangles", powers(1, 2, 3, 4), extreme=1e3)
def needles(draw: Draw, number: float) -> list[Trial]:
    """Triangles as long as the cube and a thousandth as wide."""
    n = int(number)
    ends = draw.rng.uniform(-1.0, 1.0, (2, n, 3))
    third = ends[1] + 0.002 * unit_vectors(draw.rng, n)
    return _trial(draw, np.stack([*ends, third], axis=1))
