"""glTF files: the scene's triangles, where its nodes put them."""

import numpy as np
import pytest
from mesh_writers import POINTS, Gltf, changed, corners, read, written

from reference_rt.shapes.meshes.files import data, read_mesh


def test_gltf(tmp_path):
    file = Gltf()
    file.primitive["attributes"]["NORMAL"] = file.add(np.tile(np.float32([0, 3, 4]), (5, 1)))
    expected = POINTS[None, :3]
    for name, content in (("a.gltf", file.gltf()), ("a.glb", file.glb())):
        mesh = read(tmp_path, content, name)
        assert np.array_equal(corners(mesh), expected)
        assert np.allclose(mesh.normals, [0, 0.6, 0.8], rtol=0, atol=1e-15)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a b.bin").write_bytes(file.data + b"more")
    mesh = read(tmp_path, file.gltf("parts/a%20b.bin"), "a.gltf")
    assert np.array_equal(corners(mesh), expected)


@pytest.mark.parametrize(
    ("mode", "indices", "expected"),
    [
        (4, [2, 1, 0, 0, 1, 4], [[2, 1, 0], [0, 1, 4]]),
        (5, [0, 1, 2, 3, 4], [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (5, None, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
    ],
)
def test_gltf_primitives(tmp_path, mode, indices, expected):
    file = Gltf()
    del file.primitive["indices"]
    if indices is not None:
        file.primitive["indices"] = file.add(np.array(indices, np.uint8))
    file.primitive["mode"] = mode
    # Points and lines are no surfaces.
    file.root["meshes"][0]["primitives"].append({"mode": 0, "attributes": {"POSITION": 0}})
    assert read(tmp_path, file.gltf(), "a.gltf").faces.tolist() == expected


def test_gltf_uv_and_colours(tmp_path):
    """v counts from the top, colours are linear, integers are fractions."""
    file = Gltf()
    uv = np.array([[0, 0], [65535, 0], [0, 65535], [13107, 26214], [0, 0]], np.uint16)
    rgba = np.array([[255, 51, 0, 9]] * 5, np.uint8)
    attributes = file.primitive["attributes"]
    attributes["TEXCOORD_0"] = file.add(uv, normalized=True)
    attributes["COLOR_0"] = file.add(rgba, normalized=True)
    mesh = read(tmp_path, file.gltf(), "a.gltf")
    assert np.allclose(mesh.uv, [[0, 1], [1, 1], [0, 0], [0.2, 0.6], [0, 1]], rtol=0, atol=1e-15)
    assert np.array_equal(mesh.colours, [[1, 51 / 255, 0]] * 5)
    attributes["TEXCOORD_0"] = file.add(np.float32(uv / 65536))
    attributes["COLOR_0"] = file.add(np.float32(rgba[:, :3] / 64))
    mesh = read(tmp_path, file.gltf(), "a.gltf")
    assert np.array_equal(mesh.uv[:, 1], 1.0 - np.float64(np.float32(uv[:, 1] / 65536)))
    assert np.array_equal(mesh.colours, np.float32(rgba[:, :3] / 64))


def test_gltf_interleaved(tmp_path):
    file = Gltf()
    mixed = np.hstack([POINTS + 1, np.full((5, 2), 9, np.float32)])
    file.add(mixed.reshape(-1, 1))
    view = len(file.views) - 1
    file.views[view]["byteStride"] = 20
    file.accessors.append(
        {"bufferView": view, "byteOffset": 0, "componentType": 5126, "count": 5, "type": "VEC3"}
    )
    file.primitive["attributes"]["POSITION"] = len(file.accessors) - 1
    assert np.array_equal(read(tmp_path, file.glb(), "a.glb").vertices, POINTS + 1)


def test_gltf_nodes(tmp_path):
    """Maps of nodes apply from the leaf up; each instance is there; the mirrored one faces out."""
    file = Gltf()
    half = 0.5**0.5
    file.root["nodes"] = [
        {"children": [1, 3], "translation": [10, 0, 0]},
        # First doubled, then a quarter turn about z, x to y, then moved.
        {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, half, half], "translation": [0, 0, 1]},
        {"mesh": 0},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]},
        {"mesh": 0},
    ]
    file.root["scenes"] = [{"nodes": [4]}, {"nodes": [0, 2]}]
    file.root["scene"] = 1
    a, b, c = POINTS[:3].astype(float)
    moved = POINTS[[2, 1, 0]] * [-1.0, 1, 1] + np.array([15.0, 6, 7])
    expected = [[[10, 0, 1], [10, 2, 1], [8, 0, 1]], moved, [a, b, c]]
    found = corners(read(tmp_path, file.gltf(), "a.gltf"))
    # The quarter turn is as exact as the square root of one half.
    assert np.allclose(found, np.array(expected), rtol=0, atol=1e-14)
    assert np.array_equal(found[1:], np.array(expected[1:]))


def test_gltf_parts_without_normals(tmp_path):
    file = Gltf()
    normals = file.add(np.tile(np.float32([0, 0, 2]), (5, 1)))
    second = {"attributes": {"POSITION": 0, "NORMAL": normals}, "indices": 1}
    file.root["meshes"][0]["primitives"] = [second]
    file.root["nodes"][0]["scale"] = [1, 1, -3]
    mesh = read(tmp_path, file.gltf(), "a.gltf")
    assert np.array_equal(mesh.normals, [[0, 0, -1]] * 5)
    assert np.cross(*np.diff(corners(mesh)[0], axis=0)).tolist() == [0, 0, -1]
    file.root["meshes"][0]["primitives"] = [file.primitive, second]
    mesh = read(tmp_path, file.gltf(), "a.gltf")
    assert mesh.normals is None
    assert len(mesh.vertices) == 10


@pytest.mark.parametrize("uri", ["../a.bin", "{}/a.bin", "link.bin", "%2e%2e/a.bin", "no.bin", "."])
def test_gltf_buffers_are_files_in_its_folder(tmp_path, uri):
    file = Gltf()
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "a.bin").write_bytes(file.data)
    (folder / "link.bin").symlink_to(tmp_path / "a.bin")
    path = written(folder, file.gltf(uri.format(tmp_path)), "a.gltf")
    with pytest.raises(ValueError, match="expected a file in its folder"):
        read_mesh(path)


def test_instances_do_not_fill_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(data, "LIMIT", 99)
    content = {
        n: changed(
            lambda f, n=n: f.root.update(
                nodes=[{"mesh": 0}] * n, scenes=[{"nodes": list(range(n))}]
            )
        )
        for n in (19, 20)
    }
    assert len(read(tmp_path, content[19], "a.gltf").faces) == 19
    with pytest.raises(ValueError, match="more than 99 vertices or triangles"):
        read(tmp_path, content[20], "a.gltf")
