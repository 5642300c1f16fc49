"""Polygons of mesh files: concave ones by every reader, from every first corner; corners that lack
what others have."""

import numpy as np
import pytest
from builders import random_turn
from mesh_writers import written

from reference_rt.shapes.meshes.files import obj, read_mesh
from reference_rt.shapes.meshes.files.polygons import triangulated

ARROW = np.array([[0.0, 0], [1, -1], [0, 1], [-1, -1]])
COMB = np.array([[0.0, 0], [7, 0], [7, 3], [6, 3], [6, 1], [5, 1], [5, 3], [4, 3], [4, 1], [3, 1],
                 [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]])  # fmt: skip


def spiral(n):
    angle = np.linspace(0.0, 5.0 * np.pi, n)
    out = np.stack([np.cos(angle), np.sin(angle)], axis=1) * angle[:, None]
    return np.concatenate([out[n // 5 :], 0.8 * out[: n // 5 - 1 : -1]])


POLYGONS = {"arrow": ARROW, "comb": COMB, "spiral": spiral(60)}


def placed(polygon, seed):
    """In some plane of space."""
    rng = np.random.default_rng(seed)
    turn = random_turn(rng)
    return polygon @ turn[:2] * 10.0 ** rng.integers(-3, 4) + rng.uniform(-1.0, 1.0, 3)


def area_of(polygon):
    """Gauss's formula."""
    x, y = polygon.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def vectors(vertices, faces):
    p = vertices[faces]
    return 0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", POLYGONS)
def test_concave_polygons(name, mirrored):
    """No triangle lies outside, wherever the polygon begins; all face its own side."""
    flat = POLYGONS[name][:: -1 if mirrored else 1]
    points = placed(flat, 3)
    expected = area_of(flat) * (np.linalg.norm(points[1] - points[0])
                                / np.linalg.norm(flat[1] - flat[0])) ** 2  # fmt: skip
    newell = 0.5 * np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    n, found = len(points), set()
    for first in range(n):
        corners = np.roll(np.arange(n), -first)
        faces, concave = triangulated(points, corners, np.array([n]))
        assert concave == 1
        area = vectors(points, faces)
        assert np.linalg.norm(area, axis=1).sum() == pytest.approx(expected, rel=1e-9)
        assert (area @ newell >= -1e-12 * (newell @ newell)).all()
        found.add(frozenset(tuple(np.roll(f, -f.argmin()).tolist()) for f in faces))
    assert len(found) == 1


def test_convex_polygons_are_fans():
    rng = np.random.default_rng(1)
    for n in range(4, 30):
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
        points = placed(np.stack([np.cos(angle), np.sin(angle)], axis=1), n)
        faces, concave = triangulated(points, np.arange(n), np.array([n]))
        assert concave == 0
        assert faces.tolist() == [[0, k + 1, k + 2] for k in range(n - 2)]


def test_among_other_polygons():
    """Each keeps its place; what is no polygon is left to the checks of all meshes."""
    points = np.concatenate([np.pad(ARROW, ((0, 0), (0, 1))), [[np.nan, 0, 0], [2, 2, 0]]])
    corners = np.array([1, 2, 3, 0, 1, 2, 3, 1, 2, 5, 2, 1, 0, 3, 4, 1, 2, 3, 0, 1, 2, 99])
    counts = np.array([3, 4, 3, 4, 4, 4])
    faces, concave = triangulated(points, corners, counts)
    assert concave == 2
    assert faces[[0, 3]].tolist() == [[1, 2, 3], [1, 2, 5]]
    assert [sorted(f) for f in faces[1:3].tolist()] == [[0, 2, 3], [0, 1, 2]]
    assert [sorted(f) for f in faces[4:6].tolist()] == [[0, 2, 3], [0, 1, 2]]
    assert faces[6:].tolist() == [[4, 1, 2], [4, 2, 3], [0, 1, 2], [0, 2, 99]]


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("suffix", ["obj", "ply", "off"])
def test_by_every_reader(tmp_path, suffix, first):
    corners = np.roll(np.arange(4), first)
    lines = ["{:g} {:g} 0".format(*p) for p in ARROW]
    text = {
        "obj": "".join(f"v {line}\n" for line in lines)
        + f"f {' '.join(str(k + 1) for k in corners)}\n",
        "off": "OFF\n4 1 0\n" + "\n".join([*lines, f"4 {' '.join(map(str, corners))}\n"]),
        "ply": "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n"
        "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        + "\n".join([f"4 {' '.join(map(str, corners))}", *lines, ""]),
    }[suffix]
    mesh = read_mesh(written(tmp_path, text, f"a.{suffix}"))
    assert vectors(mesh.vertices, mesh.faces)[:, 2].tolist() == [0.5, 0.5]
    assert mesh.doubtful == ("1 concave polygons",)
    assert mesh.ignored == ()


PARTLY = """v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nv 0 0 2\nvt 0.5 0\nvt 1 0.25\nvt 1 1\nvn 0 0.6 0.8
f 1/1/1 2/2/1 3/3/1\nf 1 3 4\nf 1//1 2//1 4//1\nf 1/1 3/3 5\n"""


@pytest.mark.parametrize("read", [obj.read_lines, lambda text: obj._of_scanned(obj.scan(text))])
def test_corners_keep_what_they_have(read):
    """A triangle that lacks it at a corner has what a mesh without it has."""
    raw = read(PARTLY.encode())
    unit = raw.normals / np.linalg.norm(raw.normals, axis=1, keepdims=True)
    at = {"uv": raw.uv[raw.faces], "normal": unit[raw.faces], "p": raw.vertices[raw.faces]}
    barycentrics = [[0, 0], [1, 0], [0, 1]]
    assert at["uv"].tolist() == [[[0.5, 0], [1, 0.25], [1, 1]], *[barycentrics] * 3]
    own = vectors(raw.vertices, raw.faces)
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    for k, expected in enumerate([[0, 0.6, 0.8], own[1], [0, 0.6, 0.8], own[3]]):
        np.testing.assert_allclose(at["normal"][k], [expected] * 3, rtol=0, atol=1e-15)
    assert at["p"][3].tolist() == [[0, 0, 0], [1, 1, 0], [0, 0, 2]]
    assert raw.doubtful == ("vn of some corners", "vt of some corners")
    assert raw.ignored == ()
