"""Meshes from arrays: the same as from a file, written and read again, compared by content."""

import copy
import pickle

import numpy as np
import pytest
from builders import icosphere
from mesh_writers import ply

import reference_rt as rt
from reference_rt.shapes.shape import TabulationContext


def ball():
    """Every array of a mesh, with numbers that decimal texts must not round."""
    rng = np.random.default_rng(11)
    vertices, faces = (np.array(a) for a in icosphere(1))
    vertices = vertices * rng.uniform(0.9, 1.1, (len(vertices), 1))
    normals = vertices + rng.normal(size=vertices.shape) * 0.1
    uv, colours = rng.uniform(size=(len(vertices), 2)), rng.uniform(size=vertices.shape)
    return {"vertices": vertices, "faces": faces, "normals": normals, "uv": uv, "colours": colours}


def as_file(arrays, folder):
    """The same as a .ply file of doubles."""
    names = {
        "vertices": ("x", "y", "z"),
        "normals": ("nx", "ny", "nz"),
        "uv": ("u", "v"),
        "colours": ("red", "green", "blue"),
    }
    kept = {name: columns for name, columns in names.items() if name in arrays}
    properties = [f"double {c}" for columns in kept.values() for c in columns]
    rows = np.column_stack([arrays[name] for name in kept]).tolist()
    faces = [[face] for face in arrays["faces"].tolist()]
    content = ply(
        "binary_little_endian",
        ("vertex", properties, rows),
        ("face", ["list uchar int vertex_indices"], faces),
    )
    (folder / "mesh.ply").write_bytes(content)
    return folder / "mesh.ply"


SOME = {
    "all": ("normals", "uv", "colours"),
    "bare": (),
    "normals": ("normals",),
    "uv": ("uv",),
    "colours": ("colours",),
}


def some_of(names):
    return {k: v for k, v in ball().items() if k in ("vertices", "faces", *names)}


@pytest.mark.parametrize("more", [{}, {"smooth": True}, {"face_normals": True}], ids=str)
@pytest.mark.parametrize("names", SOME.values(), ids=SOME)
def test_tables_are_those_of_the_file(tmp_path, names, more):
    """Bit for bit, under a transform too."""
    arrays = some_of(names)
    more = more | {"transform": [{"scale": [1, -2, 3]}, {"translate": [1, 2, 3]}]}
    place = TabulationContext(folder=tmp_path)
    ours = rt.Mesh(**arrays, **more).tabulate(place)
    theirs = rt.Mesh(file=as_file(arrays, tmp_path), **more).tabulate(place)
    for name, column, expected in zip(ours._fields, ours, theirs, strict=True):
        assert (column is None) == (expected is None), name
        assert column is None or np.array_equal(column, expected), name


@pytest.mark.parametrize("names", SOME.values(), ids=SOME)
def test_round_trips(names):
    """Every bit, in JSON and YAML, as lists."""
    scene = rt.Scene(shapes=(rt.Mesh(**some_of(names), smooth=True),))
    for text in (scene.to_json(), scene.to_yaml()):
        again = rt.Scene.parse(text)
        assert again == scene
        assert hash(again) == hash(scene)
        assert again.digest() == scene.digest()
        assert again.to_json() == scene.to_json()
        for name, array in some_of(names).items():
            assert np.array_equal(getattr(again.shapes[0], name), array)


def pickled(mesh):
    return pickle.loads(pickle.dumps(mesh))


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled])
def test_copies(copied):
    mesh = rt.Mesh(**ball())
    assert copied(mesh) == mesh
    assert hash(copied(mesh)) == hash(mesh)


def test_equal_by_content():
    mesh, same = rt.Mesh(**ball()), rt.Mesh(**ball())
    assert mesh == same
    assert {mesh: 1}[same] == 1
    assert (mesh | rt.Sphere()) == (same | rt.Sphere())
    for name, array in ball().items():
        other = array.copy()
        other[3, 1] = other[4, 1]
        changed = rt.Mesh(**(ball() | {name: other}))
        assert changed != mesh
        assert rt.Scene(shapes=(changed,)) != rt.Scene(shapes=(mesh,))
        assert rt.Scene(shapes=(changed,)).digest() != rt.Scene(shapes=(mesh,)).digest()
    assert mesh != rt.Sphere()
    assert mesh != "mesh"


def test_arrays_are_kept_apart():
    """As float64 and int64, whatever they were; nobody changes a mesh by changing his array."""
    arrays = ball() | {"faces": ball()["faces"].astype(np.uint32)}
    mesh = rt.Mesh(**arrays)
    for name, array in arrays.items():
        kept = getattr(mesh, name)
        assert np.array_equal(kept, array)
        assert kept.dtype == (np.int64 if name == "faces" else np.float64)
        assert not np.shares_memory(kept, array)
        array[:] = 0
        assert kept.any()
        with pytest.raises(ValueError, match="read-only"):
            kept[0, 0] = 1


def test_million_triangles_stay_arrays():
    """No lists of Python's numbers on the way: they would take more than a hundred bytes each."""
    import tracemalloc

    n = 200_000
    vertices = np.random.default_rng(1).uniform(size=(n, 3))
    faces = np.arange(3 * (n // 3)).reshape(-1, 3)
    tracemalloc.start()
    try:
        mesh = rt.Mesh(vertices=vertices, faces=faces)
        _, peak = tracemalloc.get_traced_memory()
        hash(mesh)
        _, compared = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    size = mesh.vertices.nbytes + mesh.faces.nbytes
    # The copies; masks and indices of the checks, and the bytes of one array that are hashed.
    assert peak < 3 * size
    assert compared < 3 * size


def bad(**fields):
    return ball() | fields


ODD = np.array([[0, 1, 2]])
WRONG = {
    "nothing": ({}, (), "expected a file, or vertices and faces"),
    "no faces": ({"vertices": ball()["vertices"]}, (), "expected a file, or vertices and faces"),
    "no vertices": ({"faces": ODD}, (), "expected a file, or vertices and faces"),
    "uv alone": ({"uv": ball()["uv"]}, (), "expected a file, or vertices and faces"),
    "both": (bad(file="a.obj"), ("colours",), "beside a file; expected one of the two"),
    "quads": (bad(faces=[[0, 1, 2, 3]]), ("faces",), r"expected an \(n, 3\) array"),
    "flat": (bad(faces=[0, 1, 2]), ("faces",), r"expected an \(n, 3\) array.*got int64 of shape"),
    "floats": (bad(faces=[[0, 1, 2.0]]), ("faces",), "of integers, got float64"),
    "beyond": (bad(faces=[[0, 1, 42]]), ("faces",), "index 42, out of range; expected 0 to 41"),
    "negative": (bad(faces=[[0, 1, -1]]), ("faces",), "index -1, out of range; expected 0 to 41"),
    "huge": (bad(faces=np.array([[0, 1, 2**64 - 1]], "u8")), ("faces",), "out of range"),
    "no rows": (bad(faces=np.zeros((0, 3), int)), ("faces",), "is empty; expected vertices"),
    "ragged": (bad(faces=[[0, 1, 2], [1, 2]]), ("faces",), r"expected an \(n, 3\) array"),
    "few normals": (bad(normals=np.ones((5, 3))), ("normals",), "5 normals and 42 vertices"),
    "zero normals": (bad(normals=np.zeros((42, 3))), ("normals",), "expected a direction"),
    "few uv": (bad(uv=np.ones((5, 2))), ("uv",), "5 uv and 42 vertices; expected one for each"),
    "uv of three": (bad(uv=np.ones((42, 3))), ("uv",), r"expected an \(n, 2\) array"),
    "dark": (bad(colours=-np.ones((42, 3))), ("colours",), "vertex 0 is negative"),
    "masked": (
        bad(vertices=np.ma.masked_greater(ball()["vertices"], 0.5)),
        ("vertices",),
        "masked",
    ),
}


@pytest.mark.parametrize(("fields", "path", "problem"), WRONG.values(), ids=WRONG)
def test_wrong_arrays(fields, path, problem):
    """Alone, and in a scene, with the way to them."""
    with pytest.raises(rt.SceneError, match=problem) as caught:
        rt.Mesh(**fields)
    assert caught.value.path == path
    # Among plain data arrays are lists, of which some are told in other words.
    with pytest.raises(rt.SceneError, match="expected") as caught:
        rt.Scene(groups={"g": [{"type": "sphere"}, {"type": "mesh", **fields}]})
    assert caught.value.path == ("groups", "g", 1, *path)


def test_scene_files_may_have_them():
    text = (
        "shapes:\n"
        "  - type: mesh\n"
        "    vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n"
        "    faces:\n"
        "      - [0, 1, 3]\n"
    )
    with pytest.raises(rt.SceneError, match=r":4: shapes\[0\]\.faces: face 0 has index 3"):
        rt.Scene.parse(text)
    scene = rt.Scene.parse(text.replace("3]\n", "2]\n"))
    assert scene.intersect([[0.25, 0.25, 1]], [[0, 0, -1]]).primitive.tolist() == [0]


def test_schema():
    fields = rt.json_schema()["$defs"]["Mesh"]["properties"]
    for name in ("vertices", "faces", "normals", "uv", "colours"):
        rows, none = fields[name]["anyOf"]
        assert none == {"type": "null"}
        width = 2 if name == "uv" else 3
        assert (rows["items"]["minItems"], rows["items"]["maxItems"]) == (width, width)
        assert fields[name]["description"]
