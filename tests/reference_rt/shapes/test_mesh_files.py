"""Mesh files: what a file says is what is read, to the last bit."""

import os
import zipfile

import numpy as np
import pytest
from builders import cube
from hypothesis import given
from hypothesis import strategies as st
from mesh_writers import (
    CODES,
    FACES,
    FORMS,
    POINTS,
    SQUARE,
    TRIANGLES,
    XYZ,
    Gltf,
    V,
    ascii_stl,
    binary_stl,
    check,
    corners,
    model_3mf,
    ply,
    read,
    square,
)

from reference_rt.rendering.image import srgb
from reference_rt.shapes.meshes.files import read_mesh
from reference_rt.shapes.meshes.files.data import linear
from reference_rt.shapes.meshes.files.polygons import triangulated
from reference_rt.util import memory


def decoded(x):
    """sRGB to linear, IEC 61966-2-1, one number."""
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4


def test_the_transfer_function_turns_back():
    x = np.linspace(0.0, 1.0, 1001)
    # The two branches of the standard meet within 1e-7, its constants being rounded.
    assert np.allclose(srgb(linear(x)), x, rtol=0, atol=1e-7)
    assert linear(np.array([0.0, 1.0])).tolist() == [0.0, 1.0]


# ---- .obj ---------------------------------------------------------------------------------------


def test_obj_corners_have_uv_and_normals_of_their_own(tmp_path):
    text = V + "vt 0 0\nvt 1\nvt 0.25 0.5 7\nvn 0 0 2\nvn 0 3 4\n"
    text += "f 1/1/1 2/2/1 3/3/1\nf 1/3/2 3/3/1 4/2/2\n"
    mesh = read(tmp_path, text)
    assert np.array_equal(corners(mesh), SQUARE[[[0, 1, 2], [0, 2, 3]]])
    uv = [[[0, 0], [1, 0], [0.25, 0.5]], [[0.25, 0.5], [0.25, 0.5], [1, 0]]]
    assert mesh.uv[mesh.faces].tolist() == uv
    up, aslant = [0, 0, 1], [0, 0.6, 0.8]
    assert mesh.normals[mesh.faces].tolist() == [[up] * 3, [aslant, up, aslant]]
    assert len(mesh.vertices) == 5  # 3/3/1 is one vertex of both faces


def test_obj_colours_are_encoded(tmp_path):
    text = "v 0 0 0 0 0.5 1\nv 1 0 0 1 1 1\nv 1 1 0 0.02 0.04 0.041\nf 1 2 3\n"
    found = read(tmp_path, text).colours
    expected = [[0, 0.5, 1], [1, 1, 1], [0.02, 0.04, 0.041]]
    assert np.allclose(found, np.vectorize(decoded)(expected), rtol=1e-15, atol=0)
    assert read(tmp_path, text + "v 0 0 0\n").colours is None


def test_obj_w_is_no_colour(tmp_path):
    mesh = read(tmp_path, V.replace(" 0\n", " 0 1.0\n") + "f 1 2 3\n")
    assert np.array_equal(corners(mesh), SQUARE[None, :3])
    assert mesh.colours is None


def test_obj_lines_that_go_on(tmp_path):
    text = "# here a comment ends \\\nv 0 0 \\\n 0\nv 1 0 0\nv 1 \\  \r\n1 \\\n0\nv 0 1 0\n"
    mesh = read(tmp_path, text + "f 1 2 \\\n3 4\\\n")
    assert np.array_equal(corners(mesh), SQUARE[[[0, 1, 2], [0, 2, 3]]])
    with pytest.raises(ValueError, match="line 9: index 7 of 4 'v' lines is out of range"):
        read(tmp_path, text + "f 1 2 \\\n7\n")
    # In time that grows with the file, not with its square.
    assert len(read(tmp_path, V + "f 1 2" + " \\\n" * 200_000 + " 3\n").faces) == 1


def test_obj_indices_count_back_from_where_they_stand(tmp_path):
    text = V + "vt 0 0\nf -4/-1 -3/-1 -2/-1\nv 7 7 7\nvt 1 1\nf -4/-1 -3/-2 -1/-1\n"
    mesh = read(tmp_path, text)
    assert corners(mesh)[0].tolist() == SQUARE[:3].tolist()
    assert corners(mesh)[1].tolist() == [[1, 0, 0], [1, 1, 0], [7, 7, 7]]
    assert mesh.uv[mesh.faces[1]].tolist() == [[1, 1], [0, 0], [1, 1]]


def test_polygons_are_fans_about_their_first_corner(tmp_path):
    n = 50_000
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    points = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
    text = "".join(f"v {x!r} {y!r} 0\n" for x, y, _ in points.tolist())
    mesh = read(tmp_path, text + "f " + " ".join(map(str, range(1, n + 1))) + "\n")
    k = np.arange(1, n - 1)
    fan = np.stack([np.zeros_like(k), k, k + 1], axis=1)
    assert np.array_equal(corners(mesh), points[fan])


def test_obj_opens_nothing_else(tmp_path):
    os.mkfifo(tmp_path / "pipe")  # whoever opens it, waits forever
    text = "mtllib pipe\nmaplib pipe\ncall pipe\n" + V + "usemtl pipe\nf 1 2 3\n"
    assert len(read(tmp_path, text).faces) == 1


# ---- .ply ---------------------------------------------------------------------------------------


@given(
    form=st.sampled_from(FORMS),
    types=st.tuples(st.sampled_from(["uchar", "int", "ushort"]), st.sampled_from(list(CODES)[:6])),
    faces=st.lists(st.lists(st.integers(0, 99), min_size=3, max_size=6), min_size=1, max_size=9),
    beside=st.booleans(),
)
def test_ply_of_any_polygons(tmp_path_factory, form, types, faces, beside):
    """Any mixture of polygons, whatever stands beside their corners."""
    rng = np.random.default_rng(len(faces))
    points = rng.normal(size=(100, 3)) * 10.0 ** rng.uniform(-300, 300, (100, 1))
    properties, rows = [f"list {types[0]} {types[1]} vertex_index"], [[f] for f in faces]
    if beside:
        properties = ["float quality", *properties, "list uchar float texcoord", "uchar flag"]
        rows = [[0.5, f, [0.25] * (f[0] % 4), 9] for f in faces]
    content = ply(
        form,
        ("edge", ["int vertex1", "list uint8 float64 weights"], [[1, []], [2, [0.5]]]),
        ("face", properties, rows),
        ("vertex", XYZ, points.tolist()),
        ("material", ["list uchar uchar name"], [[b"abc"], [b"abc"]]),
        ("nothing", [], []),
    )
    mesh = read(tmp_path_factory.getbasetemp(), content, "mesh.ply")
    expected = triangulated(points, np.concatenate(faces), np.array([len(f) for f in faces]))[0]
    assert np.array_equal(mesh.faces, expected)
    assert np.array_equal(mesh.vertices, points)


@pytest.mark.parametrize("form", FORMS)
def test_ply_strips(tmp_path, form):
    """A strip of n corners has n - 2 triangles, all of one side; -1 and a row's end end it."""
    points = [[x, y, 0.0] for x in range(6) for y in (0, 1)]
    vertices = ("vertex", XYZ, points)
    rows = [[list(range(7, -1, -1))], [[-1, 11, 10, 9, 8, 7, 6, -1, -1, 0, 1]]]
    strips = ("tristrips", ["list int int vertex_indices"], rows)
    mesh = read(tmp_path, ply(form, vertices, strips), "mesh.ply")
    assert len(mesh.faces) == 6 + 4
    across = np.cross(*(corners(mesh)[:, k] - corners(mesh)[:, 0] for k in (1, 2)))
    assert np.array_equal(across, [[0, 0, -1]] * 10)
    assert mesh.doubtful == ()
    both = ply(form, vertices, ("face", FACES, [[[0, 2, 1]]]), strips)
    with pytest.raises(ValueError, match="has faces and tristrips"):
        read(tmp_path, both, "mesh.ply")


@pytest.mark.parametrize("name", ["mesh.obj", "mesh.off", "mesh.ply"])
def test_a_byte_order_mark_is_no_content(tmp_path, name):
    text = {
        "mesh.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "mesh.off": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "mesh.ply": square("ascii"),
    }[name]
    content = text if isinstance(text, bytes) else text.encode()
    marked = read(tmp_path, b"\xef\xbb\xbf" + content, name)
    assert np.array_equal(corners(marked), corners(read(tmp_path, content, name)))


def test_gltf_sparse_accessors(tmp_path):
    """Values in place of some rows of a view, and of zeros; a file without scenes shows all."""
    file = Gltf()
    place, value = np.array([1, 3], np.uint16), np.array([[5, 6, 7], [8, 9, 1]], np.float32)
    views = [file.accessors[file.add(array)]["bufferView"] for array in (place, value)]
    file.accessors[0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    path = tmp_path / "a.glb"
    for rows in (POINTS, np.zeros_like(POINTS)):
        path.write_bytes(file.glb())
        expected = rows.copy()
        expected[place] = value
        assert np.array_equal(read_mesh(path).vertices, expected)
        file.accessors[0].pop("bufferView", None)
    file.accessors[0]["sparse"]["indices"]["bufferView"] = views[1]  # out of range
    path.write_bytes(file.glb())
    with pytest.raises(ValueError, match="its indices reach"):
        read_mesh(path)
    bare = Gltf()
    del bare.root["scenes"]
    bare.root["nodes"] = [{"mesh": 0}, {"children": [0], "translation": [0, 0, 2]}]
    path.write_bytes(bare.glb())
    assert np.array_equal(corners(read_mesh(path)), [POINTS[:3] + np.float32([0, 0, 2])])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("names", ["u v", "s t", "texture_u texture_v"])
def test_ply_attributes(tmp_path, form, names):
    u, v = names.split()
    properties = [f"float {n}" for n in ("x", "nx", "ny", "nz", "y", u, v, "z")]
    properties += ["uchar red", "uchar green", "uchar blue", "uchar alpha"]
    rows = [
        [x, 0.0, 3.0, 4.0, y, 0.25 * k, 0.5, z, 255, 0, 10 * k, 7]
        for k, (x, y, z) in enumerate(SQUARE.tolist())
    ]
    content = ply(form, ("vertex", properties, rows), ("face", FACES, [[[0, 1, 2]]]))
    mesh = read(tmp_path, content, "mesh.ply")
    assert np.array_equal(mesh.vertices, SQUARE)
    assert mesh.normals.tolist() == [[0, 0.6, 0.8]] * 4
    assert mesh.uv.tolist() == [[0.25 * k, 0.5] for k in range(4)]
    expected = [[1.0, 0.0, decoded(10 * k / 255)] for k in range(4)]
    assert np.allclose(mesh.colours, expected, rtol=1e-15, atol=0)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("kind", "given", "expected"),
    [("ushort", 32768, decoded(32768 / 65535)), ("float", 2.5, 2.5), ("double", 0.1, 0.1)],
)
def test_ply_colours_of_floats_are_linear(tmp_path, form, kind, given, expected):
    properties = [*XYZ, *(f"{kind} {n}" for n in ("red", "green", "blue"))]
    rows = [[*p, 0, given, 1] for p in SQUARE.tolist()]
    content = ply(form, ("vertex", properties, rows), ("face", FACES, [[[0, 1, 2]]]))
    found = read(tmp_path, content, "mesh.ply").colours
    assert np.allclose(found[:, 1], expected, rtol=1e-15, atol=0)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_ply_line_ends(tmp_path, form, newline):
    content = square(form).partition(b"end_header\n")
    content = content[0].replace(b"\n", newline.encode()) + b"end_header" + newline.encode()
    content += square(form).partition(b"end_header\n")[2]
    assert np.array_equal(corners(read(tmp_path, content, "mesh.ply")), SQUARE[None, :3])


def test_ply_numbers_of_a_text_are_what_they_say(tmp_path):
    content = square("ascii").replace(b"double", b"float").replace(b"1.0 0.0 0.0", b"0.1 1e-300 3")
    assert read(tmp_path, content, "mesh.ply").vertices[1].tolist() == [0.1, 1e-300, 3.0]


# ---- .stl and .off ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    [
        binary_stl(TRIANGLES),
        ascii_stl(TRIANGLES),
        ascii_stl(TRIANGLES).upper().replace("\n", "\r\n"),
        ascii_stl(TRIANGLES[:2], "") + "\n" + ascii_stl(TRIANGLES[2:]),
    ],
)
def test_stl(tmp_path, content):
    assert np.array_equal(corners(read(tmp_path, content, "mesh.STL")), TRIANGLES)


@pytest.mark.parametrize(
    "text",
    [
        "OFF\n4 2 0\n{}3 0 1 2\n4 0 1 2 3\n",
        "# x\nOFF 4 2 # y\n\n{}\n 3 0 1 2 255 0 0 \n\n4 0 1 2 3 # 0.5 1 0\n",
        "CNOFF\r\n4 2 5\r\n{}3 0 1 2\r\n4 0 1 2 3 1",
    ],
)
def test_off(tmp_path, text):
    points = "".join(f"{x} {y} {z} 0 0 1 9 9 9 9\n" for x, y, z in SQUARE)
    mesh = read(tmp_path, text.format(points), "mesh.off")
    assert np.array_equal(mesh.vertices, SQUARE)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]


# ---- other formats ------------------------------------------------------------------------------


def test_other_formats_are_those_of_trimesh(tmp_path, monkeypatch):
    """A format that only this test knows: two meshes in a scene."""
    from trimesh.exchange import load

    points = POINTS.astype(float)

    def loader(file_obj, **_):
        assert file_obj.read() == b"content"
        mesh = {"vertices": points[:3], "faces": [[0, 1, 2]]}
        move = np.eye(4)
        move[:3, 3] = 1, 2, 3
        graph = [
            {"frame_to": "a", "matrix": move, "geometry": "m"},
            {"frame_to": "b", "matrix": np.eye(4), "geometry": "n"},
        ]
        return {"geometry": {"m": mesh, "n": {**mesh, "vertices": points[2:]}}, "graph": graph}

    monkeypatch.setitem(load.mesh_loaders, "thing", loader)
    mesh = read(tmp_path, b"content", "a.thing")
    assert sorted(map(np.ndarray.tolist, corners(mesh))) == sorted(
        [(points[:3] + np.array([1, 2, 3])).tolist(), points[2:].tolist()]
    )
    assert mesh.normals is mesh.uv is mesh.colours is None
    with pytest.raises(ValueError, match="malformed: AssertionError"):
        read(tmp_path, b"other content", "a.thing")


def test_3mf(tmp_path):
    vertices, faces = cube(2)
    path = model_3mf(tmp_path, vertices, faces)
    mesh = read_mesh(path)
    check(mesh)
    assert np.array_equal(corners(mesh), vertices[faces] + [9, 0, 0])


def test_what_unpacks_to_much_is_refused_before(tmp_path, monkeypatch):
    """By the ratio, and by the memory of the machine."""
    with zipfile.ZipFile(tmp_path / "a.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", b" " * (1 << 25))
    sparse = Gltf()
    much = {"componentType": 5126, "type": "VEC3", "count": 10**9, "sparse": {"count": 1}}
    sparse.accessors[0] = much
    (tmp_path / "a.glb").write_bytes(sparse.glb())
    for name in ("a.3mf", "a.glb"):
        with pytest.raises(ValueError, match=r"unpacks from \d+ to \d+ bytes; expected"):
            read_mesh(tmp_path / name)
    vertices, faces = cube(2)
    path = model_3mf(tmp_path, vertices, faces)
    monkeypatch.setattr(memory, "machine_memory", lambda: 1000)
    with pytest.raises(ValueError, match=r"memory; expected at most the 0.0 GiB"):
        read_mesh(path)


@pytest.mark.parametrize("form", FORMS)
def test_ply_uv_of_corners(tmp_path, form):
    """A vertex whose texture coordinates differ between faces is several; mixed polygons."""
    faces = [[[0, 1, 2], [0, 0, 1, 0, 1, 1]], [[0, 1, 2, 3], [0, 0, 0.5, 0.25, 1, 1, 0, 1]]]
    properties = [*FACES, "list uchar float texcoord", "int texnumber"]
    rows = [[*face, 0] for face in faces]
    vertices = ("vertex", [*XYZ, "float s", "float t"], [[*p, 7, 7] for p in SQUARE.tolist()])
    mesh = read(tmp_path, ply(form, vertices, ("face", properties, rows)), "mesh.ply")
    assert np.array_equal(corners(mesh), SQUARE[[[0, 1, 2], [0, 1, 2], [0, 2, 3]]])
    uv = [[[0, 0], [1, 0], [1, 1]], [[0, 0], [0.5, 0.25], [1, 1]], [[0, 0], [1, 1], [0, 1]]]
    assert mesh.uv[mesh.faces].tolist() == uv
    assert len(mesh.vertices) == 5  # of which two are where the uv differ
    assert mesh.ignored == ("face texnumber",)
    rows[0][1] = []  # a face without
    mesh = read(tmp_path, ply(form, vertices, ("face", properties, rows)), "mesh.ply")
    assert mesh.uv.tolist() == [[7, 7]] * 4
    assert mesh.ignored == ("face texcoord", "face texnumber")
