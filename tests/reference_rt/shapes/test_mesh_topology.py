"""Where a mesh is open: edges that do not have one face in each direction."""

import numpy as np
import pytest
from builders import cube, icosphere

from reference_rt.shapes.meshes.topology import boundary_edges, describe_boundary


def soup(vertices, faces):
    return vertices[faces].reshape(-1, 9)


def directed(faces):
    return [(f[k], f[(k + 1) % 3]) for f in faces.tolist() for k in range(3)]


@pytest.mark.parametrize("solid", [cube(1), cube(4), icosphere(2)])
def test_closed_meshes(solid):
    vertices, faces = solid
    assert len(boundary_edges(faces, vertices).ends) == 0
    assert describe_boundary(soup(vertices, faces)) == ""
    # Vertices of their own for each face, and zeros of either sign: the same places.
    apart = vertices[faces].reshape(-1, 3)
    apart[(apart == 0.0) & (np.random.default_rng(1).random(apart.shape) < 0.5)] = -0.0
    assert len(boundary_edges(np.arange(len(apart)).reshape(-1, 3), apart).ends) == 0


def test_the_rim_of_a_hole():
    vertices, faces = icosphere(2)
    rng = np.random.default_rng(2)
    kept = rng.random(len(faces)) < 0.9
    edges = boundary_edges(faces[kept], vertices)
    used = set(directed(faces[kept]))
    rim = [e for e in directed(faces[kept]) if e[::-1] not in used]
    assert np.array_equal(edges.ends, vertices[rim])
    assert np.all(edges.forward == 1)
    assert np.all(edges.backward == 0)


def test_turned_and_doubled_faces():
    vertices, faces = cube(1)
    turned = faces.copy()
    turned[0] = turned[0][::-1]
    edges = boundary_edges(turned, vertices)
    assert np.array_equal(edges.ends, vertices[directed(turned[:1])])
    assert edges.forward.tolist() == [2, 2, 2]
    assert edges.backward.tolist() == [0, 0, 0]
    edges = boundary_edges(np.vstack([faces, faces[:1]]), vertices)
    assert np.array_equal(edges.ends, vertices[directed(faces[:1])])
    assert edges.forward.tolist() == [2, 2, 2]
    assert edges.backward.tolist() == [1, 1, 1]


def test_cubes_that_share_an_edge():
    """Twice in each direction: which face belongs to which is not told."""
    vertices, faces = cube(1)
    both = np.vstack([vertices, vertices + np.array([2.0, 2.0, 0.0])])
    edges = boundary_edges(np.vstack([faces, faces + len(vertices)]), both)
    assert len(edges.ends) == 1
    assert sorted(edges.ends[0].tolist()) == [[1, 1, -1], [1, 1, 1]]
    assert (edges.forward.tolist(), edges.backward.tolist()) == ([2], [2])
    away = np.vstack([vertices, vertices + np.array([np.nextafter(2.0, 3.0), 2.0, 0.0])])
    assert len(boundary_edges(np.vstack([faces, faces + len(vertices)]), away).ends) == 0


def test_faces_without_area():
    """Two equal corners: as if it were not there.  Three on a line: a bridge between the others."""
    vertices, faces = cube(1)
    a, b, c = faces[0]
    assert len(boundary_edges(np.vstack([faces, [[a, a, b], [c, c, c]]]), vertices).ends) == 0
    middle = len(vertices)
    vertices = np.vstack([vertices, 0.5 * (vertices[a] + vertices[b])])
    split = np.vstack([faces[1:], [[a, middle, c], [middle, b, c]]])
    assert len(boundary_edges(split, vertices).ends) == 3
    assert len(boundary_edges(np.vstack([split, [[a, b, middle]]]), vertices).ends) == 0


def test_what_is_said():
    vertices, faces = cube(1)
    said = describe_boundary(soup(vertices, faces[1:]))
    assert said.startswith(
        "it is not closed: 3 edges do not have one face in each direction: "
        "(-1, 1, 1) to (-1, -1, -1) has 1 and 0, "
    )
    assert said.count(" has 1 and 0") == 3
    assert said.endswith("; expected a closed mesh")
    many = describe_boundary(soup(vertices * 0.1, faces[::2]))
    assert " has 1 and 0, and 9 more; expected a closed mesh" in many
    one = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1 / 3, 0]])
    assert "(0, 0.333333333, 0)" in describe_boundary(one.reshape(1, 9))
    assert describe_boundary(np.zeros((0, 9))) == ""


def test_no_faces():
    assert len(boundary_edges(np.zeros((0, 3), np.int64), np.zeros((5, 3))).ends) == 0
