"""What holds of all readers of meshes and images alike: files without content are said to be empty,
and texts in another encoding are named by it."""

import codecs

import numpy as np
import pytest
from mesh_writers import FORMS, Gltf, V, expect_one_line, model_3mf, ply, square, written
from test_3mf import archive, model_text

import reference_rt as rt
from reference_rt.shapes.meshes.files import _READERS, read_mesh
from reference_rt.textures.image_file import read_image

XYZ = ["float x", "float y", "float z"]
LISTS = ["list uchar int vertex_indices"]
POINTS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]

EMPTY = {
    **{f"no bytes{suffix}": (suffix, b"") for suffix in _READERS},
    **{f"blanks{suffix}": (suffix, b" \n\n") for suffix in _READERS},
    "a comment.obj": (".obj", b"# nothing\n"),
    "points.obj": (".obj", V.encode()),
    "header.off": (".off", b"OFF\n0 0 0\n"),
    "points.off": (".off", b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"),
    "header.stl": (".stl", bytes(84)),
    "text.stl": (".stl", b"solid a\nendsolid a\n"),
    "archive.3mf": (".3mf", None),
    "scene.gltf": (".gltf", b'{"scenes": [{"nodes": []}]}'),
    **{
        f"{form} {what}.ply": (".ply", content)
        for form in FORMS
        for what, content in {
            "header": ply(form),
            "nothing": ply(form, ("vertex", XYZ, []), ("face", LISTS, [])),
            "no list": ply(form, ("vertex", XYZ, []), ("face", ["int a"], [])),
            "points": ply(form, ("vertex", XYZ, POINTS), ("face", LISTS, [])),
            "vertices alone": ply(form, ("vertex", XYZ, POINTS)),
            "no strips": ply(form, ("vertex", XYZ, []), ("tristrips", LISTS, [])),
        }.items()
    },
}


@pytest.mark.parametrize("name", EMPTY)
def test_empty_meshes(tmp_path, name):
    suffix, content = EMPTY[name]
    path = tmp_path / f"mesh{suffix}"
    if content is None:
        archive(tmp_path, {"3D/3dmodel.model": model_text("")}, path.name)
    else:
        path.write_bytes(content)
    with pytest.raises(ValueError, match="is empty; expected vertices and faces") as caught:
        read_mesh(path)
    expect_one_line(caught.value, f"mesh {path}")


@pytest.mark.parametrize(
    "suffix", [".png", ".jpg", ".exr", ".hdr", ".pfm", ".npy", ".tif", ".webp"]
)
def test_empty_images(tmp_path, suffix):
    path = written(tmp_path, b"", f"image{suffix}")
    with pytest.raises(ValueError, match="is empty; expected an image"):
        read_image(path, "auto")


TEXTS = {
    ".obj": V + "f 1 2 3\n",
    ".off": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    ".ply": square("ascii").decode(),
    ".stl": "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    "endloop\nendfacet\nendsolid a\n",
    ".yaml": "shapes: [{type: sphere}]\n",
    ".json": '{"shapes": [{"type": "sphere"}]}',
}
MARKS = {
    "utf-16-le": codecs.BOM_UTF16_LE,
    "utf-16-be": codecs.BOM_UTF16_BE,
    "utf-32-le": codecs.BOM_UTF32_LE,
    "utf-32-be": codecs.BOM_UTF32_BE,
}


def loaded(path):
    return (rt.Scene.load if path.suffix in (".yaml", ".json") else read_mesh)(path)


@pytest.mark.parametrize("suffix", TEXTS)
@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize("encoding", MARKS)
def test_other_encodings_are_named(tmp_path, suffix, encoding, marked):
    text = TEXTS[suffix].encode(encoding)
    path = written(tmp_path, (MARKS[encoding] if marked else b"") + text, f"a{suffix}")
    if suffix in (".yaml", ".json") and not marked:
        with pytest.raises(rt.SceneError):  # it is UTF-8 that has null characters
            loaded(path)
        return
    with pytest.raises((ValueError, rt.SceneError)) as caught:
        loaded(path)
    assert encoding[:6].upper() in str(caught.value)
    assert "UTF-8" in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("suffix", TEXTS)
def test_marks_of_utf8_are_no_content(tmp_path, suffix):
    plain, marked = (
        loaded(written(tmp_path, mark + TEXTS[suffix].encode(), f"a{suffix}"))
        for mark in (b"", codecs.BOM_UTF8)
    )
    if suffix in (".yaml", ".json"):
        assert plain.shapes == marked.shapes
    else:
        assert np.array_equal(plain.vertices[plain.faces], marked.vertices[marked.faces])


def test_binary_files_are_no_texts(tmp_path):
    """Floats whose bytes alternate with zeros, and a header that begins like a mark."""
    file = Gltf()
    for suffix, content in (
        (".glb", file.glb()),
        (".3mf", model_3mf(tmp_path, np.eye(3), [[0, 1, 2]]).read_bytes()),
        (
            ".stl",
            codecs.BOM_UTF16_LE
            + bytes(78)
            + b"\1\0\0\0"
            + bytes(12)
            + np.eye(3, dtype="<f4").tobytes()
            + bytes(2),
        ),
    ):
        assert len(read_mesh(written(tmp_path, content, f"b{suffix}")).faces) == 1


def test_headers_of_ply_files_that_end_otherwise(tmp_path):
    """The last line of a header with another end than those before it, or blanks."""
    for form in FORMS:
        head, _, body = square(form).partition(b"end_header\n")
        expected = read_mesh(written(tmp_path, head + b"end_header\n" + body, "a.ply"))
        for first, last in ((b"\n", b"\r\n"), (b"\r\n", b"\n"), (b"\n", b" \n"), (b"\n", b" \r\n")):
            content = head.replace(b"\n", first) + b"end_header" + last + body
            found = read_mesh(written(tmp_path, content, "a.ply"))
            assert np.array_equal(found.vertices, expected.vertices)
            assert np.array_equal(found.faces, expected.faces)


@pytest.mark.parametrize(
    "head", ["OFF3 1 0", "\t  OFF3 1 0 # or not", "#x\n\n OFF # y\n#\n 3 1", "COFF3 1"]
)
def test_heads_of_off_files(tmp_path, head):
    text = f"{head}\n 0 0 0\n\n# a\n 1 0 0  \n0 1 0\n  3  0 1 2  0.5 0.5 0.5\n"
    found = read_mesh(written(tmp_path, text, "a.off"))
    assert found.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert found.faces.tolist() == [[0, 1, 2]]
