#!/usr/bin/env bash
# meshio 5.3.5 reads texture coordinates of OBJ files by their order, not by the faces' indices: `f 1/4 2/3 3/2 4/1` gives
# vertex 1 the first `vt`, not the fourth, without a word, if there are as many as vertices. If there are more, as at every
# seam, it refuses the file. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check meshio==5.3.5 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'END'
import meshio

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.1 0\nvt 0.2 0\nvt 0.3 0\nvt 0.4 0\n"
with open("reversed.obj", "w") as file:
    file.write(SQUARE + "f 1/4 2/3 3/2 4/1\n")
read = meshio.read("reversed.obj")
found = read.point_data["obj:vt"][:, 0].tolist()
print("vertices 1 to 4 have, by the faces, 0.4 0.3 0.2 0.1; read:", found)
assert found == [0.1, 0.2, 0.3, 0.4]
with open("seam.obj", "w") as file:
    file.write(SQUARE + "vt 0.5 0\nf 1/5 2/2 3/3\nf 1/1 3/3 4/4\n")
try:
    meshio.read("seam.obj")
except Exception as error:
    print("five for four vertices:", error)
else:
    raise SystemExit("a seam was read")
END
