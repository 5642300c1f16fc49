#!/usr/bin/env bash
# Open3D 0.20.0 writes .glb files that it cannot read: their buffer is a base64 text in the JSON, and there is no binary
# chunk, which the glTF specification allows. trimesh 5.2.0 reads the file; Open3D's own reader returns an empty mesh, and
# does read the same mesh as .gltf. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check open3d==0.20.0 trimesh==5.2.0 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'END'
import json
import struct

import numpy as np
import open3d
import trimesh

open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
corners = open3d.utility.Vector3dVector(np.eye(4)[:, :3])
faces = open3d.utility.Vector3iVector(np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))
mesh = open3d.geometry.TriangleMesh(corners, faces)
found = {}
for ending in ("glb", "gltf"):
    open3d.io.write_triangle_mesh(f"mesh.{ending}", mesh)
    own = len(open3d.io.read_triangle_mesh(f"mesh.{ending}").triangles)
    found[ending] = own, len(trimesh.load_mesh(f"mesh.{ending}").faces)
    print(f"{ending}: triangles of four that Open3D reads: {own}, that trimesh reads: {found[ending][1]}")
data = open("mesh.glb", "rb").read()
length = struct.unpack_from("<I", data, 12)[0]
buffer = json.loads(data[20 : 20 + length])["buffers"][0]
print("after the JSON:", len(data) - 20 - length, "bytes; the buffer:", buffer["uri"][:37])
assert found == {"glb": (0, 4), "gltf": (4, 4)}
assert len(data) == 20 + length
END
