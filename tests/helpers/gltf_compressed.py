"""glTF files compressed by the libraries' own encoders, and the same ones plain."""

import json

import numpy as np
import pytest
from mesh_writers import Gltf

RNG = np.random.default_rng(19)
CELLS = np.array([[i, j] for i in range(4) for j in range(7)]) @ [8, 1]
CORNERS = np.concatenate([CELLS[:, None] + [0, 8, 9], CELLS[:, None] + [0, 9, 1]]).astype(np.uint16)
"""Triangles of a grid of 5 x 8 points: encoders of connectivity keep its vertices."""

ROWS = {
    "POSITION": RNG.normal(size=(40, 3)).astype(np.float32),
    "NORMAL": np.tile(np.float32([0.0, 0.6, 0.8]), (40, 1)),
    "TEXCOORD_0": RNG.random((40, 2)).astype(np.float32),
    "COLOR_0": RNG.integers(0, 256, (40, 4)).astype(np.uint8),
}
ROWS["COLOR_0"][:, 3] = 255


def plain(corners=CORNERS, **other):
    """A mesh with every attribute that is read."""
    file = Gltf()
    for name, rows in (ROWS | other).items():
        more = {"normalized": True} if name == "COLOR_0" else {}
        file.primitive["attributes"][name] = file.add(rows, **more)
    file.primitive["indices"] = file.add(np.ascontiguousarray(corners).reshape(-1, 1))
    return file


def by_draco(keeps_plain=False, is_required=True, **how):
    """The mesh as KHR_draco_mesh_compression;  keeps_plain: with the plain data beside it."""
    library = pytest.importorskip("DracoPy")
    data = library.encode(
        ROWS["POSITION"],
        CORNERS.astype(np.uint32),
        tex_coord=ROWS["TEXCOORD_0"].astype(float),
        normals=ROWS["NORMAL"].astype(float),
        colors=ROWS["COLOR_0"],
        **how,
    )
    kinds = {0: "POSITION", 1: "NORMAL", 2: "COLOR_0", 3: "TEXCOORD_0"}
    found = library.decode(data).attributes
    assert {len(one["data"]) for one in found} == {len(ROWS["POSITION"])}
    numbers = {kinds[one["attribute_type"]]: one["unique_id"] for one in found}
    file = plain()
    if not keeps_plain:
        for number in (*file.primitive["attributes"].values(), file.primitive["indices"]):
            del file.accessors[number]["bufferView"]
    file.views.append({"buffer": 0, "byteOffset": len(file.data), "byteLength": len(data)})
    file.data += data
    name = "KHR_draco_mesh_compression"
    extension = {"bufferView": len(file.views) - 1, "attributes": numbers}
    file.primitive["extensions"] = {name: extension}
    file.root["extensionsUsed"] = [name]
    if is_required:
        file.root["extensionsRequired"] = [name]
    return file


def by_meshopt(name="EXT_meshopt_compression", mode="TRIANGLES", keeps_plain=False):
    """The mesh with each view compressed, its plain buffer left out unless `keeps_plain`."""
    library = pytest.importorskip("meshopt")
    version = 1 if name.startswith("KHR") else 0
    file, data = plain(), b""
    last = file.accessors[file.primitive["indices"]]["bufferView"]
    for number, view in enumerate(file.views):
        begin, size = view["byteOffset"], view["byteLength"]
        raw = file.data[begin : begin + size]
        users = [a for a in file.accessors if a["bufferView"] == number]
        row, kind = size // users[0]["count"], "ATTRIBUTES"
        if number == last:
            kind = mode
            packed = library.encode_gltf_buffer(np.frombuffer(raw, np.uint16), mode, version)
        else:
            if row % 4:
                continue  # such as the indices of the writer's first triangle
            rows = np.frombuffer(raw, np.uint8).reshape(-1, row)
            packed = library.encode_gltf_buffer(rows, kind, version)
        part = {"buffer": 1, "byteOffset": len(data), "byteLength": len(packed)}
        part |= {"count": users[0]["count"], "byteStride": row, "mode": kind}
        view["extensions"] = {name: part}
        data += packed
    file.root["extensionsUsed"] = file.root["extensionsRequired"] = [name]
    return file, data, name, keeps_plain


def written_meshopt(folder, made):
    """The file as .gltf: its second buffer has what is compressed."""
    file, data, name, keeps_plain = made
    path = folder / "packed.gltf"
    root = json.loads(file.gltf("plain.bin"))
    if keeps_plain:
        (folder / "plain.bin").write_bytes(file.data)
    else:
        first = {"byteLength": len(file.data), "extensions": {name: {"fallback": True}}}
        root["buffers"] = [first]
    root["buffers"].append({"byteLength": len(data), "uri": "packed.bin"})
    (folder / "packed.bin").write_bytes(data)
    path.write_text(json.dumps(root))
    return path
