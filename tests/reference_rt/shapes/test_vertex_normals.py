"""Vertex normals that `smooth` makes: closed forms, invariances, trimesh's, and extremes."""

import numpy as np
import pytest
from builders import cube, icosphere, write_obj
from mesh_writers import ascii_stl, binary_stl

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.shapes.meshes.topology import smooth_normals
from reference_rt.shapes.meshes.triangle_table import geometric_normals
from reference_rt.shapes.shape import TabulationContext

EPS = np.finfo(float).eps
ROUNDED = 16 * EPS
"""Of a unit vector that is the sum of some six others: ten roundings each, see `TERM`, and a few of
the sum, all of half an EPS."""


def normals(vertices, faces, uv=None):
    found = smooth_normals(np.asarray(vertices, float), np.asarray(faces), uv).reshape(-1, 3, 3)
    assert np.allclose(np.linalg.norm(found, axis=2), 1.0, rtol=0, atol=4 * EPS)
    return found


def uneven_ball(seed=1):
    vertices, faces = icosphere(2)
    rng = np.random.default_rng(seed)
    return np.array(vertices) * rng.uniform(0.7, 1.3, (len(vertices), 1)), np.array(faces)


@pytest.mark.parametrize("parts", [1, 2, 3, 5])
def test_corners_of_a_cube(parts):
    """However its sides are cut into triangles: the weights of a side's triangles add up to its
    angle.  Equal weights, or those of areas, depend on the diagonals."""
    vertices, faces = cube(parts)
    vertices, faces = np.asarray(vertices, float), np.asarray(faces)
    middle, half = (vertices.max(0) + vertices.min(0)) / 2, np.ptp(vertices, axis=0) / 2
    at = (vertices - middle) / half
    outside = np.where(np.abs(at) > 1 - 1e-9, np.sign(at), 0.0)
    expected = outside / np.linalg.norm(outside, axis=1, keepdims=True)
    assert np.allclose(normals(vertices, faces), expected[faces], rtol=0, atol=ROUNDED)


def test_trimesh_makes_the_same():
    import trimesh

    vertices, faces = uneven_ball()
    theirs = trimesh.Trimesh(vertices, faces, process=False).vertex_normals
    # Its angles come from arc cosines, which lose half of the digits only near 0 and 180 degrees;
    # there are none here.
    assert np.allclose(normals(vertices, faces), theirs[faces], rtol=0, atol=64 * EPS)


@pytest.mark.parametrize("exponent", [-1060, -500, -1, 1, 500, 1020])
def test_scales(exponent):
    """Powers of two change nothing, far beyond where squares leave float64's range."""
    vertices, faces = uneven_ball()
    vertices = np.round(vertices * 2**10) * 2.0**-10  # few digits: so that tiny ones have all
    scaled = np.ldexp(vertices, exponent)
    if exponent > -1040:
        assert np.array_equal(np.ldexp(scaled, -exponent), vertices)
        assert np.array_equal(normals(scaled, faces), normals(vertices, faces))
    assert np.isfinite(normals(scaled, faces)).all()


def test_turned_with_the_mesh():
    vertices, faces = uneven_ball()
    m = transform.rotate((1, 2, 3), 40.0)
    turned = normals(transform.apply_points(m, vertices), faces)
    assert np.allclose(turned, normals(vertices, faces) @ m[:, :3].T, rtol=0, atol=64 * EPS)


def test_faces_without_area_add_nothing():
    vertices, faces = uneven_ball()
    rng = np.random.default_rng(2)
    points = np.repeat(rng.integers(0, len(vertices), (50, 1)), 3, axis=1)
    lines = rng.integers(0, len(vertices), (50, 3))
    lines[:, 2] = lines[:, 0]
    middles = vertices[faces[:20, 0]] * 0.5 + vertices[faces[:20, 1]] * 0.5
    flat = np.column_stack([faces[:20, 0], faces[:20, 1], len(vertices) + np.arange(20)])
    every = np.concatenate([points, faces, lines, flat])
    found = normals(np.concatenate([vertices, middles]), every)
    assert np.isfinite(found).all()
    of_faces = found[50 : 50 + len(faces)]
    # A middle is off the line by a rounding: a sliver of a third of an EPS, whose angles at its
    # ends are as small, and which weighs nothing there.
    assert np.allclose(of_faces, normals(vertices, faces), rtol=0, atol=ROUNDED)


def test_slivers_have_the_normal_of_their_plane():
    """A tilted plane cut into slivers of 1e-12 of their length: their two products cancel."""
    u, v = np.array([3.0, 1, 2]), np.array([-1.0, 5, 7])
    along = np.arange(9.0)[:, None]
    rows = [along * u + width * v for width in (0.0, 2.0**-40, 1.0)]
    vertices = np.concatenate(rows)
    a = np.arange(8)
    faces = np.concatenate(
        [np.column_stack([9 * k + a, 9 * k + a + 1, 9 * k + a + 9]) for k in (0, 1)]
        + [np.column_stack([9 * k + a + 1, 9 * k + a + 10, 9 * k + a + 9]) for k in (0, 1)]
    )
    n = np.cross(u, v)
    n /= np.linalg.norm(n)
    assert np.array_equal(vertices * 2**40, np.round(vertices * 2**40))  # the points are exact
    assert np.allclose(normals(vertices, faces), n, rtol=0, atol=ROUNDED)


def test_two_sides_of_a_sheet():
    """Normals that cancel: each face keeps its own, and no rounding decides."""
    rng = np.random.default_rng(3)
    for _ in range(100):
        vertices = rng.normal(size=(4, 3)) * 10.0 ** rng.uniform(-9, 9)
        vertices[3] = vertices[0] + vertices[2] - vertices[1]
        faces = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
        n = geometric_normals(vertices[faces].reshape(-1, 9))
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        found = normals(vertices, faces)
        assert np.allclose(found, n[:, None, :], rtol=0, atol=1e-9)  # n itself: of thin triangles


def test_nothing_but_faces_without_area():
    assert normals(np.ones((3, 3)), [[0, 1, 2]]).tolist() == [[[0.0, 0, 1]] * 3]


def test_equal_vertices_are_one_unless_the_texture_has_a_seam():
    """As .stl files repeat each vertex for each face."""
    vertices, faces = uneven_ball()
    shared = normals(vertices, faces)
    soup, own = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    assert np.array_equal(normals(soup, own), shared)
    of_faces = np.repeat(np.arange(len(faces)), 3)[:, None] * np.ones(2)
    apart = normals(soup, own, of_faces)
    n = geometric_normals(vertices[faces].reshape(-1, 9))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert np.allclose(apart, n[:, None, :], rtol=0, atol=64 * EPS)
    assert not np.allclose(shared, apart, rtol=0, atol=0.01)


@pytest.mark.parametrize("name", ["mesh.obj", "binary.stl", "ascii.stl", "memory"])
def test_every_reader(tmp_path, name):
    vertices, faces = uneven_ball()
    vertices = vertices.astype(np.float32).astype(float)
    if name == "mesh.obj":
        write_obj(tmp_path / name, vertices, faces)
    elif name != "memory":
        soup = vertices[faces].astype(np.float32)
        content = binary_stl(soup, attribute=0) if "bin" in name else ascii_stl(soup).encode()
        (tmp_path / name).write_bytes(content)
    place = TabulationContext(folder=tmp_path)
    source = {"vertices": vertices, "faces": faces} if name == "memory" else {"file": name}
    table = rt.Mesh(**source, smooth=True).tabulate(place)
    # The transform, of which there is none here, makes them unit again.
    found = table.normals.reshape(-1, 3, 3)
    assert np.allclose(found, normals(vertices, faces), rtol=0, atol=4 * EPS)
    assert rt.Mesh(**source).tabulate(place).normals is None


STEPS = [{"scale": [1, -2, 0.5]}, {"rotate": {"axis": [1, 2, 3], "degrees": 50}}]


def test_as_if_the_file_had_them():
    """Under any transform, that mirrors and stretches too, made normals are as given ones."""
    vertices, faces = uneven_ball()
    corner = normals(vertices, faces)
    given = np.zeros_like(vertices)
    given[faces.ravel()] = corner.reshape(-1, 3)
    fields = {"vertices": vertices, "faces": faces, "transform": STEPS}
    made = rt.Mesh(**fields, smooth=True).tabulate(TabulationContext())
    with_given = rt.Mesh(**fields, normals=given).tabulate(TabulationContext())
    assert np.array_equal(made.vertices, with_given.vertices)
    # Made unit twice, and products of matrices may add in another order.
    assert np.allclose(made.normals, with_given.normals, rtol=0, atol=8 * EPS)
    n = geometric_normals(made.vertices)
    sides = np.einsum("mki,mi->mk", made.normals.reshape(-1, 3, 3), n)
    assert (sides > 0).mean() > 0.9  # the ball is so uneven that some faces look away


def test_own_normals_stay():
    vertices, faces = uneven_ball()
    fields = {"vertices": vertices, "faces": faces, "normals": np.roll(vertices, 1, axis=1)}
    smooth = rt.Mesh(**fields, smooth=True).tabulate(TabulationContext())
    assert np.array_equal(smooth.normals, rt.Mesh(**fields).tabulate(TabulationContext()).normals)
    with pytest.raises(rt.SceneError, match=r"^smooth: beside face_normals; expected one"):
        rt.Mesh(**fields, smooth=True, face_normals=True)


def test_tiny_meshes_that_a_transform_enlarges():
    """Of 1e-150: squares of their edges are 0 in float64."""
    vertices, faces = uneven_ball()
    tiny = rt.Mesh(
        vertices=vertices * 2.0**-500, faces=faces, smooth=True, transform=[{"scale": 2.0**500}]
    ).tabulate(TabulationContext())
    usual = rt.Mesh(vertices=vertices, faces=faces, smooth=True).tabulate(TabulationContext())
    assert np.array_equal(tiny.vertices, usual.vertices)
    assert np.allclose(tiny.normals, usual.normals, rtol=0, atol=4 * EPS)
    assert len(tiny.face) == len(faces)
