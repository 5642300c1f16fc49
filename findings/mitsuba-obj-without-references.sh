#!/usr/bin/env bash
# Mitsuba 3.9.1: an OBJ file may have lines vn and vt to which no face refers (meshio 5.3.5 writes such files). The mesh then has
# vertex normals and texture coordinates all the same, and their values are in no line of the file. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6
cat > with.obj <<'END'
v 0 0 0
v 1 0 0
v 0 1 0
vn 0 0 1
vt 0.5 0.5
f 1 2 3
END
grep -v '^v[nt]' with.obj > without.obj
cat > look.py <<'END'
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
for name in ("without", "with"):
    mesh = mi.load_dict({"type": "obj", "filename": f"{name}.obj"})
    values = mi.traverse(mesh)
    uv = np.array(values["vertex_texcoords"]).reshape(-1, 2)
    print(name, "has uv:", len(uv) > 0, "those of the file:", bool(len(uv) and (uv == 0.5).all()))
END
venv/bin/python look.py | tee seen
diff seen - <<'END'
without has uv: False those of the file: False
with has uv: True those of the file: False
END
