"""Mesh files that are wrong: one line of error that says how."""

import os
import struct
import tracemalloc

import numpy as np
import pytest
from mesh_writers import (
    FACES,
    FORMS,
    TRIANGLES,
    XYZ,
    V,
    ascii_stl,
    binary_stl,
    changed,
    expect_one_line,
    ply,
    square,
    written,
)

from reference_rt.shapes.meshes.files import other, read_mesh


def ply_text(body, vertices=4, faces=1, form="ascii"):
    header = f"ply\nformat {form} 1.0\nelement vertex {vertices}\nproperty float x\n"
    header += f"property float y\nproperty float z\nelement face {faces}\n"
    return header + "property list uchar int vertex_indices\nend_header\n" + body


P = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
STL = ascii_stl(TRIANGLES)

WRONG = {
    # What is wrong in most formats.
    **{f"nothing{s}": (s, b"", "") for s in (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")},
    **{
        f"rubbish{s}": (s, bytes(range(256)) * 9, "")
        for s in (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
    },
    **{
        f"zeros{s}": (s, bytes(5000), "") for s in (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
    },
    "unknown": (".xyzw", "0 0 0", "'.xyzw' is not supported; expected one of .obj, .ply, .stl, "),
    "no suffix": ("", V, "'' is not supported; expected one of .obj, "),
    # .obj
    "obj: index": (".obj", V + "f 1 2 5\n", "line 5: index 5 of 4 'v' lines is out of range"),
    "obj: zero": (".obj", V + "f 0 1 2\n", "line 5: index 0 of 4 'v' lines is out of range"),
    "obj: far back": (".obj", V + "f -1 -2 -5\n", "line 5: index -5 of 4 'v' lines is out of"),
    "obj: vn range": (".obj", V + "f 1//1 2 3\n", "line 5: index 1 of 0 'vn' lines is"),
    "obj: word": (".obj", V + "f 1 2 x\n", "line 5: "),
    "obj: two corners": (".obj", V + "f 1 2\n", "line 5: a face has fewer than three corners"),
    "obj: NaN": (".obj", "v 0 0 nan\n", "line 1: 'v' needs three finite numbers"),
    "obj: infinity": (".obj", "v 0 1e999 0\n", "line 1: 'v' needs three finite numbers"),
    "obj: two numbers": (".obj", "v 0 0\n", "line 1: 'v' needs three finite numbers"),
    "obj: words": (".obj", "v a b c\n", "line 1: could not convert"),
    "obj: no faces": (".obj", V, "is empty; expected vertices and faces"),
    "obj: colour of two": (".obj", "v 0 0 0 1 1\n", "line 1: 'v' has a colour that is not three"),
    "obj: colour of 255": (".obj", "v 0 0 0 255 0 0\n", "line 1: 'v' has a colour that is not"),
    "obj: NaN colour": (".obj", "v 0 0 0 1 nan 1\n", "line 1: 'v' has a colour that is not"),
    "obj: empty vt": (".obj", "vt\n", "line 1: 'vt' needs one to three finite numbers"),
    "obj: NaN vt": (".obj", "vt 0 inf\n", "line 1: 'vt' needs one to three finite numbers"),
    "obj: vt range": (".obj", V + "f 1/1 2 3\n", "line 5: index 1 of 0 'vt' lines is out of range"),
    "obj: four indices": (".obj", V + "f 1/1/1/1 2 3\n", "line 5: '1/1/1/1' is no corner; expect"),
    "obj: no position": (".obj", V + "f /1 2 3\n", "line 5: '' is not an index; expected an int"),
    "obj: float index": (".obj", V + "f 1 2 3.0\n", "line 5: '3.0' is not an index; expected an"),
    "obj: bytes": (".obj", V.encode() + b"f 1 2 \xff\n", "line 5: '\ufffd' is not an index"),
    "obj: endless": (".obj", V + f"f 1 2 {10**30}\n", f"line 5: index {10**30} of 4 'v' lines"),
    "obj: digits": (".obj", V + "f 1 2 " + "9" * 5000 + "\n", "line 5: '99999999999999999999' is"),
    "obj: later": (".obj", "f 1 2 3\n" + V, "line 1: index 1 of 0 'v' lines is out of range"),
    "obj: zero vn": (".obj", V + "vn 0 0 0\nf 1//1 2//1 3//1\n", "a vertex normal is zero or not"),
    # .ply
    "ply: cut header": (".ply", ply_text("")[:60], "is malformed: "),
    "ply: cut, binary": (".ply", square(FORMS[1])[:-9], "is malformed: "),
    "ply: endless": (".ply", ply_text(P, vertices=10**12), "is malformed: "),
    "ply: endless, binary": (".ply", ply_text(P, 10**12, form=FORMS[1]), "is malformed: "),
    "ply: version": (".ply", "ply\nformat ascii 2.0\nend_header\n", "line 2: 'format ascii 2.0'"),
    "ply: no format": (".ply", "ply\nend_header\n", "'format'"),
    "ply: no end": (".ply", "ply\nformat ascii 1.0\n", "no line 'end_header'"),
    "ply: count": (".ply", ply_text(P, vertices=-4), "line 3: 'element vertex -4'; expected"),
    "ply: big count": (".ply", ply_text(P, vertices="9" * 5000), "line 3: Exceeds the limit"),
    "ply: type": (".ply", ply_text(P).replace("float z", "real z"), "line 6: property 'real z'"),
    "ply: float count": (".ply", ply_text(P).replace("uchar", "float"), "line 8: property 'list"),
    "ply: float index": (".ply", ply_text(P).replace(" int", " float"), "are floats; expected in"),
    "ply: no x": (".ply", ply_text(P + "3 0 1 2").replace("float x", "float w"), "lacks x, y or z"),
    "ply: y twice": (".ply", ply_text(P).replace("float x", "float y"), "a name twice"),
    "ply: no indices": (".ply", ply_text(P).replace("vertex_i", "i"), "no list 'vertex_indices'"),
    "ply: vertex list": (".ply", ply_text(P).replace("float x", "list uchar float x"),
     "element 'vertex' has a list"),
    "ply: early property": (".ply", "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
     "line"),
    "ply: cut": (".ply", ply_text(P + "3 0 1"), "it ends within row 0 of 'face'"),
    "ply: cut vertex": (".ply", ply_text("0 0 0\n1 0"), "it ends within the 4 rows of 'vertex'"),
    "ply: too long": (".ply", ply_text(P + "3 0 1 2 9"), "1 numbers are left after all that"),
    "ply: too long, binary": (".ply", square(FORMS[1]) + b"\n", "1 bytes are left after all that"),
    "ply: word": (".ply", ply_text(P + "3 0 1 x"), "line 5 after its header: 'x' is not a number"),
    "ply: joined": (".ply", ply_text(P + "3 0 1-2"), "line 5 after its header: '1-2' is not a num"),
    "ply: half index": (".ply", ply_text(P + "3 0 1 1.5"), "it has an index that is no integer"),
    "ply: half count": (".ply", ply_text(P + "3.5 0 1 2"), "a list of 3.5 numbers; expected a"),
    "ply: NaN count": (".ply", ply_text(P + "nan 0 1 2"), "a list of nan numbers; expected a"),
    "ply: huge count": (".ply", ply_text(P + "1e300 0 1 2"), "it ends within row 0 of 'face'"),
    "ply: negative list": (".ply",
     square(FORMS[1]).replace(b"uchar", b"char")[:-13] + b"\xff" + bytes(12),
     "a list of -1 numbers; expected a count"),
    "ply: two corners": (".ply", ply_text(P + "2 0 1"), "face 0 has 2 corners; expected at least"),
    "ply: index": (".ply", ply_text(P + "3 0 1 4"), "face 0 has index 4, out of range; expected 0"),
    "ply: negative": (".ply", ply_text(P + "3 0 -1 2"), "face 0 has index -1, out of range"),
    "ply: far index": (".ply", ply_text(P + "3 0 1e300 2"), "face 0 has index "),
    "ply: infinity": (".ply", ply_text(P.replace("1", "inf", 1) + "3 0 1 2"), "vertex 1 is not fi"),
    "ply: no faces": (".ply", ply_text(P, faces=0), "is empty; expected vertices and faces"),
    "ply: int colour": (".ply",
     ply("ascii", ("vertex", [*XYZ, "int red", "int green", "int blue"], [[0] * 6])),
     "its colours have an odd type; expected uchar"),
    "ply: colour of 256": (
        ".ply",
        ply(
            "ascii", ("vertex", [*XYZ, *(f"uchar {c}" for c in ("red", "green", "blue"))], [])
        ).replace(b"vertex 0", b"vertex 1")
        + b"0 0 0 0 256 0",
        "it has a colour that is not from 0 to 255",
    ),
    "ply: negative colour": (
        ".ply",
        ply(
            "ascii",
            ("vertex", [*XYZ, "float red", "float green", "float blue"], [[0] * 5 + [-1]]),
            ("face", FACES, [[[0, 0, 0]]]),
        ),
        "the colour of vertex 0 is negative or not finite",
    ),
    "ply: NaN uv": (".ply",
     ply("ascii", ("vertex", [*XYZ, "float s", "float t"], []), ("face", FACES, [[[0, 0, 0]]]))
     .replace(b"vertex 0", b"vertex 1") .replace(b"3 0 0 0", b"0 0 0 1 nan 3 0 0 0"),
     "the uv of vertex 0 is not finite"),
    # .stl
    "stl: cut": (".stl", binary_stl(TRIANGLES, b"x")[:-1], "it has 333 bytes; expected 334 for"),
    "stl: endless": (".stl", b"x" * 80 + b"\xff" * 8, "expected 214748364834 for the 4294967295 t"),
    "stl: cut text": (".stl", STL[:-40], "expected a whole facet of three vertices, or 'endsolid'"),
    "stl: no end": (".stl", STL[: STL.index("endsolid")], "after line 36: expected a whole facet"),
    "stl: two numbers": (".stl", "solid\n" + STL.replace("vertex", "vertex 0 ", 1),
     "after line 1:"),
    "stl: word": (".stl", STL.replace("0 nan", "0 0", 1).replace("vertex ", "vertex x"),
     "could no"),
    "stl: NaN": (".stl", STL.replace("vertex", "vertex nan 1 2 vertex", 1), "after line 1: "),
    "stl: infinity": (".stl", binary_stl(TRIANGLES * np.inf), "vertex 0 is not finite"),
    "stl: no triangle": (".stl", "solid\nendsolid\n", "is empty; expected vertices and faces"),
    "stl: no triangle, binary": (".stl", bytes(84), "is empty; expected vertices and faces"),
    # .off
    "off: 4OFF": (".off", "4OFF\n1 1 0\n", "expected 'OFF' as its first word"),
    "off: binary": (".off", "OFF BINARY\n", "line 1: expected the numbers of vertices and faces"),
    "off: endless": (".off", f"OFF\n{10**12} 1 0\n{P}", "line 2: 1000000000000 vertices and 1 fa"),
    "off: negative": (".off", f"OFF\n-4 1 0\n{P}", "line 2: -4 vertices and 1 faces do not fit in"),
    "off: vertex": (".off", "OFF\n4 1 0\n0 0 0\n0 0\n1 1 1\n", "line 4: expected a vertex, x y z"),
    "off: cut": (".off", f"OFF\n4 2 0\n{P}3 0 1 2\n", "it ends within its 4 vertices and 2 faces"),
    "off: cut line": (".off", f"OFF\n4 1 0\n{P}3 0 1\n", "line 7: 2 of 3 corners; expected three"),
    "off: edge": (".off", f"OFF\n4 1 0\n{P}2 0 1\n", "line 7: 2 of 2 corners; expected three or"),
    "off: more": (".off", f"OFF\n4 1 0\n{P}3 0 1 2\n3 0 1 2\n", "line 8: something is left after"),
    "off: index": (".off", f"OFF\n4 1 0\n{P}3 0 1 4\n", "face 0 has index 4, out of range"),
    "off: far index": (".off", f"OFF\n4 1 0\n{P}3 0 1 {10**30}\n", "line 7: expected a face, n i1"),
    # .gltf, .glb
    "gltf: no JSON": (".gltf", "{", "is malformed: "),
    "gltf: a list": (".gltf", "[]", "its JSON is no object"),
    "gltf: nested": (".gltf", "[" * 10**6, "is malformed: RecursionError"),
    "gltf: nothing": (".gltf", "{}", "is empty; expected vertices and faces"),
    "gltf: negative node": (".gltf", changed(lambda f: f.root.update(scenes=[{"nodes": [-1]}])),
     "it has no nodes[-1]"),
    "gltf: cycle": (".gltf", changed(lambda f: f.root["nodes"][0].update(children=[0])),
     "nodes[0] has two parents; expected a tree"),
    "gltf: endless": (".gltf", changed(lambda f: f.accessors[0].update(count=10**12)),
     "accessors[0] reaches beyond its view"),
    "gltf: stride": (".gltf", changed(lambda f: f.views[0].update(byteStride=4)),
     "accessors[0] reaches beyond its view"),
    "gltf: negative offset": (".gltf", changed(lambda f: f.accessors[0].update(byteOffset=-4)),
     "'byteOffset' is -4; expected an integer of at least 0"),
    "gltf: view": (".gltf", changed(lambda f: f.views[0].update(byteLength=10**9)),
     "the view of accessors[0] reaches beyond its buffer"),
    "gltf: endless zeros": (".gltf",
     changed(lambda f: (f.accessors[0].pop("bufferView"), f.accessors[0].update(count=10**12))),
     "accessors[0] unpacks from 0 to 12000000000000 bytes; expected at most 200 times"),
    "gltf: no rows": (".gltf",
     changed(lambda f: (f.accessors[0].pop("bufferView"), f.accessors[0].update(count=0))),
     "accessors[0] is empty"),
    "gltf: version 1": (".gltf", changed(lambda f: f.root.update(asset={"version": "1.1"})),
     "cannot be read: it has version '1.1' of glTF; expected 2.0"),
    "gltf: index": (".gltf",
     changed(lambda f: f.primitive.update(indices=f.add(np.array([0, 1, 5], np.uint8)))),
     "a part of 5 vertices has indices 0 to 5"),
    "gltf: two corners": (".gltf",
     changed(lambda f: f.primitive.update(indices=f.add(np.array([0, 1], np.uint8)))),
     "a primitive of 2 corners; expected whole triangles"),
    "gltf: required": (".gltf",
     changed(lambda f: f.root.update(extensionsRequired=["XYZ_mesh_of_another_kind"])),
     "cannot be read: it requires the extension 'XYZ_mesh_of_another_kind', which is unknown"),
    "gltf: singular": (".gltf", changed(lambda f: f.root["nodes"][0].update(rotation=[0, 0, 0, 0])),
     "a node's 'rotation' is zero; expected a unit quaternion"),
    "gltf: NaN": (".gltf",
     changed(lambda f: f.root["nodes"][0].update(translation=[0, 0, float("nan")])),
     "a node's 'translation' is not 3 finite numbers"),
    "gltf: overflow": (".gltf",
     changed(lambda f: f.root["nodes"][0].update(scale=[1e308, 1e308, 1e308])),
     "vertex 4 is not finite"),
    "gltf: key": (".gltf", changed(lambda f: f.primitive.pop("attributes")), "malformed: KeyError"),
    "glb: cut": (".glb", changed(lambda f: None, "glb")[:-3], "its header says version 2, "),
    "glb: JSON": (".glb", struct.pack("<4sII", b"glTF", 2, 12), "it has no JSON chunk"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(tmp_path, name):
    suffix, content, message = WRONG[name]
    path = written(tmp_path, content, f"mesh{suffix}")
    other.suffixes()  # imports trimesh, whose size is not what is measured
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"^mesh ") as caught:
            read_mesh(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    expect_one_line(caught.value, f"mesh {path}")
    assert message in str(caught.value)
    # Nothing that a file only promises; deeply nested JSON takes some.
    assert peak < 30_000_000


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.obj")  # whoever opens it, waits forever
    (tmp_path / "folder.ply").mkdir()
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    (tmp_path / "loop.obj").symlink_to(tmp_path / "loop.obj")
    for name, reason in (
        ("pipe.obj", "is a pipe, not a regular file"),
        ("folder.ply", "Is a directory"),
        ("zero.stl", "is a device, not a regular file"),
        ("loop.obj", "Too many levels of symbolic links"),
        ("no.obj", "No such file or directory"),
        ("null\0.obj", "embedded null"),  # byte, or character in path: by Python's version
    ):
        with pytest.raises(ValueError, match=r"^cannot read mesh ") as caught:
            read_mesh(tmp_path / name)
        assert str(caught.value).startswith(f"cannot read mesh {tmp_path / name}: ")
        assert reason in str(caught.value)
        assert str(caught.value).endswith("; expected a file")
