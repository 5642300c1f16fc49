#!/usr/bin/env bash
# PyMeshLab 2025.7.post1 makes other triangles of the same concave polygon, of area 10, in an OBJ or OFF file, where they fill
# it, and in a PLY file, where they are a fan of area 14 that covers some of it twice, and more. trimesh 5.2.0 makes the fan
# of all three. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check pymeshlab==2025.7.post1 trimesh==5.2.0 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'END'
import pymeshlab
import trimesh

CORNERS = ["0 0 0", "4 0 0", "4 4 0", "2 1 0", "0 4 0"]  # a square without a triangle of height 3
FILES = {
    "obj": "".join(f"v {c}\n" for c in CORNERS) + "f 1 2 3 4 5\n",
    "off": "OFF\n5 1 0\n" + "\n".join(CORNERS) + "\n5 0 1 2 3 4\n",
    "ply": "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + "\n".join(CORNERS) + "\n5 0 1 2 3 4\n",
}
areas = {}
for ending, text in FILES.items():
    with open(f"concave.{ending}", "w") as file:
        file.write(text)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(f"concave.{ending}")
    area = float(meshes.get_geometric_measures()["surface_area"])
    areas[ending] = (round(area, 6), round(float(trimesh.load_mesh(f"concave.{ending}").area), 6))
    print(f"{ending}: area by PyMeshLab {areas[ending][0]}, by trimesh {areas[ending][1]}")
assert areas == {"obj": (10, 14), "off": (10, 14), "ply": (14, 14)}
END
