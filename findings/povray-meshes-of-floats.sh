#!/usr/bin/env bash
# POV-Ray 3.7.0.10 (Debian 12) computes in double precision, but keeps the vertices of meshes as float32: a triangle of a
# `mesh2` at z = 0.1 is hit at 0.1000000015, a `triangle` and a `polygon` there at 0.1 to eleven digits and more. The
# colour is 0.5 + 1e8 (z - 0.1). Seen on 2026-11-28.
set -euo pipefail
command -v povray > /dev/null || { echo "needs POV-Ray: apt install povray"; exit 1; }
povray --version 2>&1 | grep -m 1 -o 'POV-Ray 3\.7[0-9.]*[0-9]'
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > depth.pov <<'END'
#version 3.7;
global_settings { assumed_gamma 1 }
camera { orthographic location <0, 0, 1> direction -z right 6*x up y }
#declare T = texture {
  pigment { function { 0.5 + 1e8 * (z - 0.1) } color_map { [0 rgb 0] [1 rgb 1] } }
  finish { ambient 0 diffuse 0 emission 1 }
}
mesh2 {
  vertex_vectors { 3, <-3, -1, 0.1>, <-1, -1, 0.1>, <-2, 1, 0.1> } face_indices { 1, <0, 1, 2> } texture { T }
}
triangle { <-1, -1, 0.1>, <1, -1, 0.1>, <0, 1, 0.1> texture { T } }
polygon { 4, <1, -1, 0.1>, <3, -1, 0.1>, <2, 1, 0.1>, <1, -1, 0.1> texture { T } }
END
povray +Idepth.pov +Oout.ppm +FP16 +W3 +H1 -D -A File_Gamma=1 2> log || { cat log; exit 1; }
python3 - <<'END'
import struct

data = open("out.ppm", "rb").read()
pixels = struct.unpack(">9H", data[-18:])
z = [0.1 + (value / 65535.0 - 0.5) * 1e-8 for value in pixels[::3]]
print("mesh2, triangle, polygon:", ", ".join(f"{x:.12f}" for x in z))
single = struct.unpack("f", struct.pack("f", 0.1))[0]
assert abs(z[0] - single) < 1e-12
assert abs(z[1] - 0.1) < 1e-12 and abs(z[2] - 0.1) < 1e-12
END
