#!/usr/bin/env bash
# trimesh 5.2.0 loads valid glTF files whose arrays are not plain floats, without a word, as something else:
# - triangle fans (mode 6): no mesh at all;
# - sparse accessors: the values that they replace are kept;
# - COLOR_0 as normalized unsigned shorts: the low byte is taken, so that a half becomes 0;
# - POSITION as normalized shorts (KHR_mesh_quantization, required by the file): the integers, not the fractions.
# Expected by the glTF 2.0 specification, 3.7.2.1, 3.6.2.3 and 3.6.2.2. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check trimesh==5.2.0 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'END'
import base64
import json

import numpy as np
import trimesh

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
FIRST = np.array([0, 1, 2], np.uint16)
FLOAT, SHORT, USHORT = 5126, 5122, 5123


def load(arrays, accessors, primitive, strides=None, **extra):
    """The meshes that trimesh makes of one primitive; each array is a buffer view of its own."""
    data, views = b"", []
    for array in arrays:
        data += bytes(-len(data) % 4)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        data += array.tobytes()
    for view, stride in (strides or {}).items():
        views[view]["byteStride"] = stride
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    with open("mesh.gltf", "w") as file:
        json.dump(
            {
                "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [primitive]}], "accessors": accessors, "bufferViews": views,
                "buffers": [{"uri": uri, "byteLength": len(data)}], **extra,
            },
            file,
        )
    return list(trimesh.load_scene("mesh.gltf").geometry.values())


corners = {"bufferView": 0, "componentType": FLOAT, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
faces = {"bufferView": 1, "componentType": USHORT, "count": 3, "type": "SCALAR"}

fan = load([SQUARE], [corners], {"attributes": {"POSITION": 0}, "mode": 6})
print("fan of two triangles:", [len(mesh.faces) for mesh in fan] or "no mesh")

sparse = {
    "count": 1, "indices": {"bufferView": 2, "componentType": USHORT}, "values": {"bufferView": 3},
}
moved = load(
    [SQUARE, FIRST, np.array([2], np.uint16), np.array([[5, 5, 0]], np.float32)],
    [{**corners, "sparse": sparse, "max": [5, 5, 0]}, faces],
    {"attributes": {"POSITION": 0}, "indices": 1},
)[0]
print("corner 2, which a sparse accessor moves to (5, 5, 0):", moved.vertices[2].tolist())

halves = np.full((4, 4), 32768, np.uint16)
coloured = load(
    [SQUARE, FIRST, halves],
    [corners, faces, {"bufferView": 2, "componentType": USHORT, "normalized": True, "count": 4, "type": "VEC4"}],
    {"attributes": {"POSITION": 0, "COLOR_0": 2}, "indices": 1},
)[0]
print("colour 32768 of 65535, of 255:", coloured.visual.vertex_colors[0].tolist())

used = ["KHR_mesh_quantization"]
thirds = np.array([[0, 0, 0, 0], [32767, 0, 0, 0], [0, 32767, 0, 0]], np.int16)  # rows of 8 bytes
short = {"bufferView": 0, "componentType": SHORT, "normalized": True, "count": 3, "type": "VEC3"}
integers = load(
    [thirds, FIRST],
    [{**short, "min": [0, 0, 0], "max": [32767, 32767, 0]}, faces],
    {"attributes": {"POSITION": 0}, "indices": 1},
    strides={0: 8}, extensionsUsed=used, extensionsRequired=used,
)[0]
print("corner 1, which is (1, 0, 0):", integers.vertices[1].tolist())

assert fan == []
assert moved.vertices[2].tolist() == [1.0, 1.0, 0.0]
assert coloured.visual.vertex_colors[0].tolist() == [0, 0, 0, 0]
assert integers.vertices[1].tolist() == [32767.0, 0.0, 0.0]
END
