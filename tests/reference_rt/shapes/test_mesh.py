"""Mesh files: what they hold is what is rendered, or an error with the line."""

import numpy as np
import pytest
from builders import cube, write_obj
from mesh_writers import SQUARE, V, corners, read, square

import reference_rt as rt
from reference_rt.shapes.meshes.mesh import read_mesh


def test_every_bit_of_an_obj(tmp_path):
    rng = np.random.default_rng(41)
    vertices = rng.normal(size=(30, 3)) * 10.0 ** rng.uniform(-300, 300, (30, 1))
    faces = rng.permutation(30).reshape(10, 3)
    read = read_mesh(write_obj(tmp_path / "mesh.obj", vertices, faces))
    assert np.array_equal(read.vertices[read.faces], vertices[faces])


@pytest.mark.parametrize("count", [1, 3])
def test_quadrilaterals_become_two_triangles(tmp_path, count):
    """Three of them have as many numbers as four triangles: nothing must take them for these."""
    expected = np.tile(SQUARE[[[0, 1, 2], [0, 2, 3]]], (count, 1, 1))
    assert np.array_equal(corners(read(tmp_path, V + "f 1 2 3 4\n" * count)), expected)
    content = square("binary_little_endian", [(0, 1, 2, 3)] * count)
    assert np.array_equal(corners(read(tmp_path, content, "mesh.ply")), expected)


@pytest.mark.parametrize("face", ["1 2 3", "1/1 2/1 3/1", "1//1 2//1 3//1", "1/1/1 2/1/1 3/1/1"])
def test_ways_to_write_a_face(tmp_path, face):
    text = "# caf\xe9\n" + V + f"vt 0 0\nvn 0 0 1\ng a\nusemtl b\ns 1\nf {face} # end\n"
    mesh = read(tmp_path, text.encode("latin-1").replace(b"\n", b"\r\n"))
    assert np.array_equal(corners(mesh), SQUARE[None, :3])
    assert (mesh.normals is None) == ("//" not in face and face.count("/") < 6)


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


def test_missing_mesh(refused, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text("shapes:\n  - {type: mesh, file: no.obj}\n")
    assert refused(3, "explain", str(scene)) == (
        f"{scene}:2: shapes[0]: cannot read mesh {tmp_path / 'no.obj'}: No such file or "
        "directory; expected a file"
    )
