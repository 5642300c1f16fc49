"""Accessors without data, and compressed ones: the mesh of the plain file, or one line that names
the extension and what reads it."""

import json
import sys

import numpy as np
import pytest
from gltf_compressed import CORNERS, ROWS, by_draco, by_meshopt, plain, written_meshopt
from mesh_writers import POINTS, Gltf, check, corners, written

import reference_rt as rt
from reference_rt.shapes.meshes.files import read_mesh

PIP = "pip install 'reference-rt[gltf]'"


REFUSED = (ValueError, rt.SceneError)


def forget_libraries(monkeypatch):
    for name in ("DracoPy", "meshopt"):
        monkeypatch.setitem(sys.modules, name, None)


def read(path):
    mesh = read_mesh(path)
    check(mesh)
    return mesh


def same(found, expected):
    for name in ("vertices", "faces", "normals", "uv", "colours"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name


@pytest.fixture
def expected(tmp_path):
    return read(written(tmp_path, plain().glb(), "plain.glb"))


@pytest.mark.parametrize("form", ["gltf", "glb"])
def test_accessors_without_a_view_are_zeros(tmp_path, form):
    """3.6.2 of the specification; of every attribute and of the indices."""
    file = Gltf()
    zeros = {"TEXCOORD_0": "VEC2", "COLOR_0": "VEC3", "indices": "SCALAR"}
    for name, kind in zeros.items():
        code = 5126 if name != "indices" else 5121
        count = 6 if name == "indices" else len(POINTS)
        file.accessors.append({"componentType": code, "count": count, "type": kind})
        part = file.primitive if name == "indices" else file.primitive["attributes"]
        part[name] = len(file.accessors) - 1
    mesh = read(written(tmp_path, getattr(file, form)(), f"a.{form}"))
    assert np.array_equal(mesh.vertices, POINTS)
    assert mesh.uv.tolist() == [[0.0, 1.0]] * len(POINTS)  # v counts from the top there
    assert not mesh.colours.any()
    assert mesh.faces.tolist() == [[0, 0, 0]] * 2
    del file.accessors[0]["bufferView"]
    assert not read(written(tmp_path, getattr(file, form)(), f"a.{form}")).vertices.any()


def test_zeros_do_not_fill_the_memory(tmp_path):
    """Neither one accessor nor many."""
    for count in (1, 40):
        file = Gltf()
        rows = 10**9 if count == 1 else 10**6
        primitives = file.root["meshes"][0]["primitives"]
        for _ in range(count):
            file.accessors.append({"componentType": 5126, "count": rows, "type": "VEC3"})
            primitives.append({"attributes": {"POSITION": len(file.accessors) - 1}})
            primitives[-1]["indices"] = 1
        with pytest.raises(ValueError, match=r"unpacks from \d+ to \d+ bytes"):
            read_mesh(written(tmp_path, file.glb(), "a.glb"))


def test_draco(tmp_path, expected):
    file = by_draco(preserve_order=True, quantization_bits=30)
    for form in ("gltf", "glb"):
        path = written(tmp_path, getattr(file, form)(), f"packed.{form}")
        found = read(path)
        assert np.array_equal(found.faces, expected.faces)
        # Steps of 30 bits are finer than float32, to which the values are rounded, twice.
        extent = np.ptp(ROWS["POSITION"])
        assert np.abs(found.vertices - expected.vertices).max() <= 2.0**-22 * extent
        for name in ("normals", "uv", "colours"):
            assert np.array_equal(getattr(found, name), getattr(expected, name)), name


@pytest.mark.parametrize("bits", [8, 14])
@pytest.mark.parametrize("level", [0, 7, 10])
def test_draco_in_another_order(tmp_path, expected, bits, level):
    """As encoders write it: triangles and vertices in another order, positions rounded."""
    file = by_draco(compression_level=level, quantization_bits=bits)
    found = read(written(tmp_path, file.glb(), "packed.glb"))
    step = np.ptp(ROWS["POSITION"], axis=0).max() / (2**bits - 1)
    assert len(found.faces) == len(expected.faces)
    left = corners(expected)
    for triangle in corners(found):
        turned = (np.roll(left, -k, axis=1) for k in range(3))
        error = min(np.abs(one - triangle).max(axis=(1, 2)).min() for one in turned)
        assert error <= 0.5 * step + 2.0**-22  # and roundings to float32


def test_draco_beside_plain_data_needs_no_library(tmp_path, expected, monkeypatch):
    file = by_draco(keeps_plain=True, is_required=False)
    forget_libraries(monkeypatch)
    same(read(written(tmp_path, file.glb(), "packed.glb")), expected)


@pytest.mark.parametrize("required", [True, False])
def test_without_draco_the_extension_is_named(tmp_path, monkeypatch, required):
    file = by_draco(is_required=required)
    path = written(tmp_path, file.glb(), "packed.glb")
    forget_libraries(monkeypatch)
    for load in (read_mesh, rt.Scene.load):
        with pytest.raises(REFUSED, match="KHR_draco_mesh_compression") as error:
            load(path)
        assert PIP in str(error.value)
        assert str(path) in str(error.value)


def test_draco_that_is_none(tmp_path):
    """Data that Draco did not write, and counts and numbers that are not its own."""
    file = by_draco()
    number = file.primitive["attributes"]["POSITION"]
    for change, said in (
        (lambda: file.accessors[number].update(count=41), "has 41 rows; its data have shape"),
        (
            lambda: file.primitive["extensions"]["KHR_draco_mesh_compression"].update(
                attributes={"POSITION": 77}
            ),
            "have no 'POSITION'",
        ),
        (
            lambda: file.primitive["extensions"]["KHR_draco_mesh_compression"].update(bufferView=0),
            "its data of KHR_draco_mesh_compression are damaged",
        ),
    ):
        change()
        with pytest.raises(ValueError, match=said):
            read_mesh(written(tmp_path, file.glb(), "packed.glb"))


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("mode", ["TRIANGLES", "INDICES"])
def test_meshopt(tmp_path, expected, name, mode):
    """Lossless: bit for bit, but for where a triangle begins."""
    found = read(written_meshopt(tmp_path, by_meshopt(name, mode)))
    turned = [np.roll(expected.faces, -k, axis=1) for k in range(3)]
    assert all(any((t[i] == face).all() for t in turned) for i, face in enumerate(found.faces))
    if mode == "INDICES":
        assert np.array_equal(found.faces, expected.faces)
    for part in ("vertices", "normals", "uv", "colours"):
        assert np.array_equal(getattr(found, part), getattr(expected, part)), part


def test_meshopt_beside_plain_data_needs_no_library(tmp_path, expected, monkeypatch):
    path = written_meshopt(tmp_path, by_meshopt(keeps_plain=True))
    forget_libraries(monkeypatch)
    same(read(path), expected)


def octahedral(rows):
    """Unit vectors of rows x, y, 1 in 8 bits: an octahedron's surface, unfolded (Meyer 2010)."""
    x, y, one = (rows[:, k].astype(float) for k in range(3))
    x, y = x / one, y / one
    z = 1.0 - np.abs(x) - np.abs(y)
    t = np.maximum(-z, 0.0)
    v = np.stack([x - np.copysign(t, x), y - np.copysign(t, y), z], axis=1)
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_meshopt_filters(tmp_path):
    """Normals as points of an octahedron, positions as mantissas with a common exponent: what
    their formulas say of the rows that the encoder's filters wrote."""
    library = pytest.importorskip("meshopt")
    rng = np.random.default_rng(4)
    n = rng.normal(size=(40, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    with_w = np.concatenate([n, np.zeros((40, 1))], axis=1)
    folded = library.encode_filter_oct(with_w, 4, 8)
    shared = library.encode_filter_exp(ROWS["POSITION"], 15)
    whole = np.ascontiguousarray(shared).view("<i4")
    mantissa, exponent = (whole << 8) >> 8, whole >> 24
    positions = np.ldexp(mantissa.astype(float), exponent)
    file = plain(NORMAL=np.zeros((40, 4), np.int8))
    made = {"NORMAL": (folded, "OCTAHEDRAL", 4), "POSITION": (shared, "EXPONENTIAL", 12)}
    data, name = b"", "EXT_meshopt_compression"
    for key, (rows, decoder, stride) in made.items():
        accessor = file.accessors[file.primitive["attributes"][key]]
        view = file.views[accessor["bufferView"]]
        packed = library.encode_gltf_buffer(rows, "ATTRIBUTES")
        part = {"buffer": 1, "byteOffset": len(data), "byteLength": len(packed), "count": 40}
        part |= {"byteStride": stride, "mode": "ATTRIBUTES", "filter": decoder}
        # Only this view is compressed: the others stay in a buffer with data.
        view |= {"buffer": 2, "byteOffset": 0, "byteLength": 40 * stride, "byteStride": stride}
        view["extensions"] = {name: part}
        accessor["type"] = "VEC3"
        data += packed
    normal = file.accessors[file.primitive["attributes"]["NORMAL"]]
    normal |= {"componentType": 5120, "normalized": True}
    (tmp_path / "plain.bin").write_bytes(file.data)
    (tmp_path / "packed.bin").write_bytes(data)
    root = json.loads(file.gltf("plain.bin"))
    root["buffers"] += [
        {"byteLength": len(data), "uri": "packed.bin"},
        {"byteLength": 40 * 12, "extensions": {name: {"fallback": True}}},
    ]
    found = read(written(tmp_path, json.dumps(root), "packed.gltf"))
    assert np.array_equal(found.vertices, positions)
    assert np.abs(positions - ROWS["POSITION"]).max() < 2.0**-12
    # Decoded rows are rounded to 8 bits, and of these the direction is read.
    error = np.abs(found.normals - octahedral(np.ascontiguousarray(folded).view(np.int8)))
    assert error.max() < 1.0 / 127.0


def test_without_meshopt_the_extension_is_named(tmp_path, monkeypatch):
    path = written_meshopt(tmp_path, by_meshopt())
    forget_libraries(monkeypatch)
    for load in (read_mesh, rt.Scene.load):
        with pytest.raises(REFUSED, match="EXT_meshopt_compression") as error:
            load(path)
        assert PIP in str(error.value)


def test_as_scenes(tmp_path):
    """What a scene shows of a compressed file is what it shows of the plain one."""
    (expected,) = scene(written(tmp_path, plain().glb(), "plain.glb")).shapes
    file = by_draco(preserve_order=True, quantization_bits=30)
    (by_one,) = scene(written(tmp_path, file.glb(), "packed.glb")).shapes
    (by_other,) = scene(written_meshopt(tmp_path, by_meshopt(mode="INDICES"))).shapes
    for found in (by_one, by_other):
        assert np.array_equal(found.faces, expected.faces)
        assert np.array_equal(found.colours, expected.colours)
        assert np.abs(np.asarray(found.vertices) - expected.vertices).max() < 2.0**-20
    assert len(expected.faces) == len(CORNERS)


def scene(path):
    with pytest.warns(rt.SceneWarning):  # of the camera and the light that it has not
        return rt.Scene.load(path)
