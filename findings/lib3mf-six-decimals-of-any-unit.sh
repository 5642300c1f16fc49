#!/usr/bin/env bash
# lib3mf 2.5.0, the 3MF consortium's own library, writes six digits after the point and cuts off the others, whatever the
# model's unit is: of a part in metres it keeps micrometres, so that 12.34567 micrometres come back as 12, and in millimetres
# as 12.345, not 12.346. Coordinates in memory are float32, with seven digits of each. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check lib3mf==2.5.0 numpy==2.4.6
cd "$work"
"$work/venv/bin/python" - <<'END'
import lib3mf
from lib3mf import ctypes

LENGTH = 12.34567e-6  # metres
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def read_back(unit, metres):
    """The length of an edge in metres, written and read again."""
    library = lib3mf.Wrapper()
    model = library.CreateModel()
    model.SetUnit(unit)
    mesh = model.AddMeshObject()
    for corner in CORNERS:
        place = lib3mf.Position()
        place.Coordinates = (ctypes.c_float * 3)(*(c * LENGTH / metres for c in corner))
        mesh.AddVertex(place)
    for face in FACES:
        triangle = lib3mf.Triangle()
        triangle.Indices = (ctypes.c_uint32 * 3)(*face)
        mesh.AddTriangle(triangle)
    model.AddBuildItem(mesh, library.GetIdentityTransform())
    model.QueryWriter("3mf").WriteToFile("part.3mf")
    other = library.CreateModel()
    other.QueryReader("3mf").ReadFromFile("part.3mf")
    meshes = other.GetMeshObjects()
    meshes.MoveNext()
    return meshes.GetCurrentMeshObject().GetVertex(1).Coordinates[0] * metres


in_metres = read_back(lib3mf.ModelUnit.Meter, 1.0)
in_millimetres = read_back(lib3mf.ModelUnit.MilliMeter, 1e-3)
print(f"{LENGTH:.7g} m comes back as {in_metres:.7g} m from a file in metres, {in_millimetres:.7g} m from one in millimetres")
assert abs(in_metres - 12e-6) < 1e-11
assert abs(in_millimetres - 12.345e-6) < 1e-12
END
