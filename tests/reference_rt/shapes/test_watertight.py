"""Rays inside a closed mesh never leave it, with a hierarchy and without; rays in its planes.

F3 of the stability suites has more meshes, sizes and distances, and numbers of crossings."""

import numpy as np
import pytest
from builders import U, cube, icosphere, placed, unit_vectors, write_obj

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering import query
from reference_rt.scene import build_hierarchies

MESHES = {"ball": icosphere(3), "coarse cube": cube(1), "coarse ball": icosphere(1)}
RAYS = 100_000


@pytest.mark.parametrize(
    ("mesh", "bvh_from"), [("ball", 1), ("coarse ball", 1000), ("coarse cube", 1000)]
)
def test_no_ray_leaks(mesh, bvh_from, tmp_path, monkeypatch):
    """Aimed at vertices, at middles of edges, at points along edges, and anywhere."""
    vertices, faces = MESHES[mesh]
    monkeypatch.setattr(build_hierarchies, "BVH_FROM", bvh_from)
    steps = placed(np.random.default_rng(5), 1.0, 100.0)
    file = write_obj(tmp_path / "mesh.obj", vertices, faces)
    scene = rt.build_tables(rt.Scene(shapes=(rt.Mesh(file=str(file), transform=steps),)))
    m = transform.affine(steps)
    rng = np.random.default_rng(11)
    corners = transform.apply_points(m, vertices)[faces][rng.integers(0, len(faces), RAYS)]
    a, b = corners[:, 0], corners[:, 1]
    along = rng.uniform(0, 1, (RAYS, 1))
    # The meshes contain the ball of radius 0.55 about their middle.
    o = transform.apply_points(m, rng.uniform(-0.31, 0.31, (RAYS, 3)))
    d = [a - o, (a + b) / 2 - o, a * along + b * (1 - along) - o, unit_vectors(rng, RAYS)]
    aim = rng.integers(0, 4, RAYS)
    d = np.choose(aim[:, None], d)
    assert np.isfinite(query.intersect(scene, o, d).t).all()


def test_rays_in_a_plane_hit_what_is_there(tmp_path):
    """Rays that run in the plane of a cut-up square, but for rounding, see its triangles from the
    edge: barycentrics are ratios of numbers that almost cancel.  The point that is named lies on
    the triangle: off its box by no more than 40 u (|o| + size), of the 79 u that hierarchies allow.
    """
    rng = np.random.default_rng(2)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    ticks = np.linspace(-1.0, 1.0, 25)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3) @ turn.T
    i, j = (a.ravel() for a in np.meshgrid(np.arange(24), np.arange(24), indexing="ij"))
    a, b = 25 * i + j, 25 * (i + 1) + j
    faces = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    file = write_obj(tmp_path / "square.obj", vertices, faces)
    scene = rt.build_tables(rt.Scene(shapes=(rt.Mesh(file=str(file)),)))
    n = 200_000
    ends = np.concatenate([rng.uniform(-1.0, 1.0, (2, n, 2)), np.zeros((2, n, 1))], axis=2) @ turn.T
    tilt = rng.choice([0.0, 1e-16, 1e-15, 1e-14], (n, 1)) * rng.choice([-1.0, 1.0], (n, 1))
    d = ends[1] - ends[0] + tilt * turn[:, 2]
    o = ends[0] - d * rng.uniform(0.0, 2.0, (n, 1))
    found = query.closest_primitives(scene, o, d)
    hit = found.kind >= 0
    assert 0.8 < hit.mean() < 1.0
    corners = scene.geometry.shapes.triangles.vertices.reshape(-1, 3, 3)[found.row[hit]]
    at = np.asarray(found.t[hit], np.longdouble)[:, None]
    p = np.asarray(o[hit], np.longdouble) + at * d[hit]
    beyond = np.maximum(corners.min(axis=1) - p, p - corners.max(axis=1)).max()
    assert beyond <= 40 * U * (np.abs(o).max() + 1.0)
