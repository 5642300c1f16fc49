"""A mesh file's vertex attributes are read under every usual name, or named in a warning."""

import re

import numpy as np
import pytest
from mesh_writers import (
    FACES,
    FORMS,
    SQUARE,
    TRIANGLES,
    XYZ,
    Gltf,
    V,
    ascii_stl,
    binary_stl,
    changed,
    ply,
    read,
    written,
)

import reference_rt as rt
from reference_rt.cli.explain import explain
from reference_rt.shapes.meshes.files import read_mesh

RGB = [0.25, 0.5, 0.75]
COLOUR_NAMES = [
    "red green blue",
    "r g b",
    "diffuse_red diffuse_green diffuse_blue",
    "color_0 color_1 color_2",
    "color_1 color_2 color_3",
    "color_r color_g color_b",
    "color_x color_y color_z",
    "color_red color_green color_blue",
    "colour_0 colour_1 colour_2",
    "vertex_color_0 vertex_color_1 vertex_color_2",
    "vertex_color_r vertex_color_g vertex_color_b",
]


def square_ply(form, properties, values, more=(), faces=FACES, face_values=()):
    rows = [[*p, *values] for p in SQUARE.tolist()]
    face_rows = [[[0, 1, 2], *face_values], [[0, 2, 3], *face_values]]
    return ply(form, ("vertex", [*XYZ, *properties], rows), ("face", faces, face_rows), *more)


@pytest.mark.parametrize("names", COLOUR_NAMES)
@pytest.mark.parametrize("form", FORMS)
def test_names_of_colours(tmp_path, form, names):
    properties = [f"double {name}" for name in names.split()]
    mesh = read(tmp_path, square_ply(form, properties, RGB), "mesh.ply")
    assert mesh.colours.tolist() == [RGB] * 4
    assert mesh.ignored == ()
    bytes_ = square_ply(form, [p.replace("double", "uchar") for p in properties], [255, 0, 255])
    assert read(tmp_path, bytes_, "mesh.ply").colours.tolist() == [[1.0, 0.0, 1.0]] * 4


def test_of_several_colours_one_is_read(tmp_path):
    names = ["color_0", "color_1", "color_2", "red", "green", "blue", "alpha"]
    content = square_ply("ascii", [f"float {n}" for n in names], [9, 9, 9, *RGB, 1])
    mesh = read(tmp_path, content, "mesh.ply")
    assert mesh.colours.tolist() == [RGB] * 4
    assert mesh.ignored == tuple(f"vertex {n}" for n in (*names[:3], "alpha"))


def test_two_channels_are_no_colour(tmp_path):
    mesh = read(tmp_path, square_ply("ascii", ["float red", "float green"], [0, 1]), "mesh.ply")
    assert mesh.colours is None
    assert mesh.ignored == ("vertex red", "vertex green")


def gltf_with(**attributes):
    def change(file):
        for name, rows in attributes.items():
            file.primitive["attributes"][name] = file.add(rows)

    return changed(change)


def with_key(key, value):
    return changed(lambda file: file.root.__setitem__(key, value))


def _lines(file):
    file.root["meshes"][0]["primitives"].append({**file.primitive, "mode": 1})


def _targets(file):
    file.primitive["targets"] = [{"POSITION": 0}]


def _uv_of_one_part(file):
    file.root["meshes"][0]["primitives"].append(
        {
            **file.primitive,
            "attributes": {"POSITION": 0, "TEXCOORD_0": file.add(np.zeros((5, 2), "<f4"))},
        }
    )


OFF = "{}OFF\n4 1 0\n0 0 0{v}\n1 0 0{v}\n1 1 0{v}\n0 1 0{v}\n3 0 1 2{f}\n"
FACE = "f 1 2 3\n"
IGNORED = {
    "ply: other attributes": ("ply", square_ply("ascii", ["float confidence", "int id"], [1, 2]),
        ("vertex confidence", "vertex id")),
    "ply: half a uv": ("ply", square_ply("ascii", ["float u"], [1]), ("vertex u",)),
    "ply: faces": ("ply", square_ply("ascii", [], [], faces=[*FACES, "uchar red", "float quality"],
        face_values=[1, 2]), ("face red", "face quality")),
    "ply: elements": ("ply", square_ply("ascii", [], [], [("edge", ["int vertex1"], [[0], [1]])]),
        ("element edge",)),
    "ply: of binary files": ("ply", square_ply("binary_big_endian", ["float nx"], [1]),
        ("vertex nx",)),
    "obj: materials": ("obj", "mtllib a.mtl\n" + V + "usemtl b\n" + FACE + "usemtl c\n",
        ("mtllib (materials)", "usemtl (materials)")),
    "obj: lines and points": ("obj", V + FACE + "l 1 2\np 1\nvp 1 2\n",
        ("l (lines)", "p (points)", "vp")),
    "obj: some colours": ("obj", V + "v 0 0 1 1 0 0\n" + FACE, ("colours of some v",)),
    "obj: smoothing groups": ("obj", V + "s 1\n" + FACE, ("s (smoothing groups)",)),
    "obj: weights": ("obj", V + "v 0 0 1 2\n" + FACE, ("w of v",)),
    "obj: three texture coordinates": ("obj", V + "vt 0 0 0.5\nf 1/1 2/1 3/1\n", ("w of vt",)),
    "off: colours": ("off", OFF.format("C", v=" 1 0 0 1", f=""), ("colours of vertices",)),
    "off: normals": ("off", OFF.format("N", v=" 0 0 1", f=""), ("normals of vertices",)),
    "off: uv": ("off", OFF.format("ST", v=" 0 1", f=""), ("texture coordinates of vertices",)),
    "off: all": ("off", OFF.format("STCN", v=" 0 0 1", f=""),
        ("texture coordinates and colours and normals of vertices",)),
    "off: unnamed": ("off", OFF.format("", v=" 7", f=""), ("further numbers of vertices",)),
    "off: faces": ("off", OFF.format("", v="", f=" 255 0 0"), ("colours of faces",)),
    "stl: attributes": ("stl", binary_stl(TRIANGLES), ("attributes of triangles",)),
    "gltf: other attributes": ("gltf", gltf_with(TEXCOORD_1=np.zeros((5, 2), "<f4"),
        TANGENT=np.ones((5, 4), "<f4"), _ID=np.zeros((5, 1), "<u2")),
        ("TEXCOORD_1", "TANGENT", "_ID")),
    "gltf: alpha": ("gltf", gltf_with(COLOR_0=np.full((5, 4), 0.5, "<f4")), ("alpha of COLOR_0",)),
    "gltf: materials": ("gltf", with_key("materials", [{}]), ("materials",)),
    "gltf: animations": ("gltf", with_key("animations", [{}]), ("animations",)),
    "gltf: skins": ("gltf", with_key("skins", [{}]), ("skins",)),
    "gltf: lines": ("gltf", changed(_lines), ("points or lines",)),
    "gltf: targets": ("gltf", changed(_targets), ("targets",)),
    "gltf: uv of one part": ("gltf", changed(_uv_of_one_part), ("uv of some parts",)),
}  # fmt: skip


@pytest.mark.parametrize(("suffix", "content", "names"), IGNORED.values(), ids=IGNORED)
def test_what_is_not_read_is_named(tmp_path, suffix, content, names):
    """By the warning of the scene and by `explain`, in one line for each mesh."""
    path = written(tmp_path, content, f"mesh.{suffix}")
    assert read_mesh(path).ignored == names
    scene = rt.Scene(shapes=(rt.Sphere(), rt.Mesh(file=str(path))))
    line = f"mesh {path}: ignored: {', '.join(names)}; expected positions, faces"
    with pytest.warns(rt.SceneWarning, match=re.escape(f"shapes[1]: {line}")) as caught:
        tables = scene.tables
    assert len(caught) == 1
    _, left_out = explain(scene, tables)
    assert next(why for what, why in left_out if what == "of shapes[1]").startswith(line)


NOTHING = {
    "ply": square_ply("ascii", ["float nx", "float ny", "float nz", "float s", "float t",
        "uchar red", "uchar green", "uchar blue"], [0, 0, 1, 0.5, 0.5, 1, 2, 3]),
    "obj": "# made by hand\no thing\ng part\n" + V + "vt 0 0\nvn 0 0 1\ns 1\nf 1/1/1 2/1/1 3/1/1\n",
    "obj ": V + "s off\ns 0\n" + FACE,
    "obj  ": "v 0 0 0 1.0\n" + V + "vt 0.5 0.5 0.0\nf 1/1 2/1 3/1\n",
    "off": OFF.format("", v="", f=""),
    "stl": binary_stl(TRIANGLES, attribute=0),
    "stl ": ascii_stl(TRIANGLES),
    "gltf": gltf_with(NORMAL=np.tile(np.array([0, 0, 1], "<f4"), (5, 1)),
        TEXCOORD_0=np.zeros((5, 2), "<f4"), COLOR_0=np.full((5, 4), 1.0, "<f4")),
    "gltf ": Gltf().gltf(),
}  # fmt: skip


@pytest.mark.parametrize("name", NOTHING)
def test_nothing_is_named_where_all_is_read(tmp_path, name):
    assert read_mesh(written(tmp_path, NOTHING[name], f"mesh.{name.strip()}")).ignored == ()


def test_colours_of_formats_that_trimesh_reads(tmp_path):
    library = pytest.importorskip("DracoPy")
    colours = np.full((4, 4), 9, np.uint8)
    content = library.encode(SQUARE, np.array([[0, 1, 2]], np.uint32), colors=colours)
    (name,) = read_mesh(written(tmp_path, content, "mesh.drc")).ignored
    assert name == "vertex colours or textures"


def test_long_lists_are_cut(tmp_path):
    names = [f"float a{k}" for k in range(99)]
    path = written(tmp_path, square_ply("ascii", names, [0] * 99), "mesh.ply")
    with pytest.warns(rt.SceneWarning, match=r"vertex a11, 87 more; expected positions"):
        rt.Scene(shapes=(rt.Mesh(file=str(path)),)).tables  # noqa: B018
