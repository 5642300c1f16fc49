"""Mesh files: what they hold is what is rendered, or an error with the line."""

import struct

import numpy as np
import pytest
from builders import cube, write_obj

import reference_rt as rt
from reference_rt.rendering import query
from reference_rt.shapes.meshes.mesh import read_mesh

V = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
HEADER = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
)
POINTS = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)


def ply(vertices=4, faces=1, body=b"", form="binary_little_endian"):
    return HEADER.format(form, vertices, faces).encode() + body


def corners(tmp_path, content, name="mesh.obj"):
    """The triangles (m, 3, 3) of a file."""
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    mesh = read_mesh(tmp_path / name)
    return mesh.vertices[mesh.faces], mesh


def test_every_bit_of_an_obj(tmp_path):
    rng = np.random.default_rng(41)
    vertices = rng.normal(size=(30, 3)) * 10.0 ** rng.uniform(-300, 300, (30, 1))
    faces = rng.permutation(30).reshape(10, 3)
    read = read_mesh(write_obj(tmp_path / "mesh.obj", vertices, faces))
    assert np.array_equal(read.vertices[read.faces], vertices[faces])


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_ply(tmp_path, form):
    order = ">" if "big" in form else "<"
    points = np.frombuffer(POINTS, "<f4").reshape(4, 3)
    body = points.astype(order + "f4").tobytes() + struct.pack(order + "B3i", 3, 0, 1, 2)
    if form == "ascii":
        body = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n"
    found, _ = corners(tmp_path, ply(body=body, form=form), "mesh.ply")
    assert np.array_equal(found, points[None, :3])


@pytest.mark.parametrize("count", [1, 3])
def test_quadrilaterals_become_two_triangles(tmp_path, count):
    """Three of them have as many numbers as four triangles: nothing must take them for these."""
    a, b, c, d = np.frombuffer(POINTS, "<f4").reshape(4, 3).astype(float)
    expected = np.array([[a, b, c], [a, c, d]] * count)
    assert np.array_equal(corners(tmp_path, V + "f 1 2 3 4\n" * count)[0], expected)
    body = POINTS + struct.pack("<B4i", 4, 0, 1, 2, 3) * count
    assert np.array_equal(corners(tmp_path, ply(4, count, body), "mesh.ply")[0], expected)


def test_indices_count_back_from_where_they_stand(tmp_path):
    found, _ = corners(tmp_path, V + "f -4 -3 -2\nv 7 7 7\nf 1 2 -1\n")
    assert found[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert found[1].tolist() == [[0, 0, 0], [1, 0, 0], [7, 7, 7]]


def test_a_vertex_may_have_a_normal_for_each_face(tmp_path):
    text = V + "vn 0 0 1\nvn 0 2 0\nf 1//1 2//1 3//1\nf 1//2 3//2 4//2\n"
    _, mesh = corners(tmp_path, text)
    expected = [[[0, 0, 1]] * 3, [[0, 1, 0]] * 3]
    assert mesh.normals[mesh.faces].tolist() == expected


@pytest.mark.parametrize("face", ["1 2 3", "1/1 2/1 3/1", "1//1 2//1 3//1", "1/1/1 2/1/1 3/1/1"])
def test_ways_to_write_a_face(tmp_path, face):
    text = "# caf\xe9\n" + V + f"vt 0 0\nvn 0 0 1\ng a\nusemtl b\ns 1\nf {face} # end\n"
    found, mesh = corners(tmp_path, text.encode("latin-1").replace(b"\n", b"\r\n"))
    assert found.tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]]]
    assert (mesh.normals is None) == ("//" not in face and face.count("/") < 6)


def test_triangles_without_area_are_left_out(tmp_path):
    """They have no normal.  The others keep the numbers of the file."""
    (tmp_path / "mesh.obj").write_text(V + "v 0.5 0.5 0\nf 1 5 3\nf 1 2 3\nf 2 2 3\nf 1 3 4\n")
    with pytest.warns(rt.SceneWarning, match="2 of 4 triangles have no area"):
        scene = rt.build_tables(rt.Scene(shapes=(rt.Mesh(file=str(tmp_path / "mesh.obj")),)))
    rng = np.random.default_rng(42)
    o = np.column_stack([rng.uniform(-1, 2, (5000, 2)), np.full(5000, 2.0)])
    d = rng.uniform(0, 1, (5000, 1)) * [1, 1, 0] - o  # at the diagonal, where it lay
    found = query.intersect(scene, o, d)
    hit = np.isfinite(found.t)
    assert hit.mean() > 0.99
    assert np.array_equal(found.n[hit], np.tile([0.0, 0, 1], (hit.sum(), 1)))
    assert set(found.primitive[hit]) == {1, 3}


def test_meshes_are_placed_and_turned_like_other_shapes(tmp_path):
    """The cube as a mesh and as a box, under the same transform: the same picture of normals."""
    write_obj(tmp_path / "cube.obj", *cube(2))
    steps = "[{scale: [1, 0.5, 0.7]}, {rotate: {axis: [1, 2, 3], degrees: 50}}]"
    pictures = []
    for shape in ("type: box", "type: mesh, file: cube.obj"):
        scene = rt.Scene.parse(
            "integrator: {type: ray_cast}\n"
            "camera: {type: orthographic, width: 3, eye: [0, 0, 4]}\n"
            "film: {width: 40, height: 40}\n"
            f"shapes: [{{{shape}, transform: {steps}}}]",
            folder=tmp_path,
        )
        pictures.append(rt.render(scene).layers)
    box, mesh = pictures
    assert np.array_equal(box["id"], mesh["id"])
    assert (box["id"] == 0).mean() > 0.1
    # Both normals are unit vectors after a few roundings of numbers about 1.
    assert np.allclose(box["normal"], mesh["normal"], rtol=0, atol=1e-14)


WRONG = {
    "out of range": ("mesh.obj", V + "f 1 2 5\n", "line 5: index 5 of 4 'v' lines is out of range"),
    "zero": ("mesh.obj", V + "f 0 1 2\n", "line 5: index 0 of 4 'v' lines is out of range"),
    "far back": ("mesh.obj", V + "f -1 -2 -5\n", "line 5: index -5 of 4 'v' lines is out of range"),
    "normal out of range": ("mesh.obj", V + "f 1//1 2 3\n", "line 5: index 1 of 0 'vn' lines is"),
    "not an index": ("mesh.obj", V + "f 1 2 x\n", "line 5: "),
    "two corners": ("mesh.obj", V + "f 1 2\n", "line 5: a face has fewer than three corners"),
    "NaN": ("mesh.obj", "v 0 0 nan\n", "line 1: 'v' needs three finite numbers"),
    "infinity": ("mesh.obj", "v 0 1e999 0\n", "line 1: 'v' needs three finite numbers"),
    "two coordinates": ("mesh.obj", "v 0 0\n", "line 1: 'v' needs three finite numbers"),
    "words": ("mesh.obj", "v a b c\n", "line 1: could not convert"),
    "zero normal": ("mesh.obj", V + "vn 0 0 0\nf 1//1 2//1 3//1\n", "a vertex normal is zero"),
    "no faces": ("mesh.obj", V, "is empty; expected vertices and faces"),
    "nothing": ("mesh.obj", "", "is empty; expected vertices and faces"),
    "rubbish": ("mesh.obj", b"\x80\xff\x00\n" * 50, "is empty; expected"),
    "no area": ("mesh.obj", V + "f 1 1 2\n", "no triangle has any area"),
    "unknown format": (
        "mesh.xyzw",
        "solid",
        "'.xyzw' is not supported; expected one of .obj, .ply, .stl, .off, .glb, .gltf",
    ),
    "ply: cut": ("mesh.ply", ply(body=POINTS + b"\x03\0\0"), "is malformed: "),
    "ply: cut earlier": ("mesh.ply", ply(body=POINTS[:20]), "is malformed: "),
    "ply: cut header": ("mesh.ply", ply()[:60], "is malformed: "),
    "ply: rubbish": ("mesh.ply", bytes(range(256)), "is malformed: Not a ply file!"),
    "ply: nothing": ("mesh.ply", "", "is malformed: Not a ply file!"),
    "ply: no faces": ("mesh.ply", ply(faces=0, body=POINTS), "is empty; expected vertices and"),
    "ply: endless": ("mesh.ply", ply(vertices=10**12, body=POINTS), "is malformed: "),
    "ply: index": (
        "mesh.ply",
        ply(body=POINTS + struct.pack("<B3i", 3, 0, 1, 7)),
        "index 7, out of",
    ),
    "ply: negative": (
        "mesh.ply",
        ply(body=POINTS + struct.pack("<B3i", 3, 0, 1, -1)),
        "index -1, out",
    ),
    "ply: NaN": (
        "mesh.ply",
        ply(
            body=struct.pack("<12f", *[0] * 5, float("nan"), *range(6))
            + struct.pack("<B3i", 3, 0, 1, 2)
        ),
        "vertex 1 is not finite",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_mesh(name, refused, tmp_path):
    file, content, message = WRONG[name]
    (tmp_path / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    scene = tmp_path / "scene.yaml"
    scene.write_text(f"film: {{}}\nshapes:\n  - {{type: mesh, file: {file}}}\n")
    said = refused(3, "render", str(scene), "-o", str(tmp_path / "out.exr"))
    assert said.startswith(f"{scene}:3: shapes[0]: mesh {tmp_path / file}")
    assert message in said


def test_missing_mesh(refused, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text("shapes:\n  - {type: mesh, file: no.obj}\n")
    assert refused(3, "explain", str(scene)) == (
        f"{scene}:2: shapes[0]: cannot read mesh {tmp_path / 'no.obj'}: No such file or "
        "directory; expected a file"
    )
