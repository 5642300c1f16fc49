#!/usr/bin/env bash
# Mitsuba 3.9.1, texture `checkerboard`: where it gives a colour, the cell at uv = (0.25, 0.25) is `color0`; where it
# gives a number (roughness, opacity, weight), the same cell is `color1`. A checkerboard that is used for both the
# colour and the roughness of a floor has its rough cells where the other colour is. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
venv/bin/python - <<'END'
import mitsuba as mi

mi.set_variant("scalar_rgb")
texture = mi.load_dict({"type": "checkerboard", "color0": 0.25, "color1": 0.75})
point = mi.SurfaceInteraction3f()
point.uv = [0.25, 0.25]
colour, number = texture.eval(point)[0], texture.eval_1(point)
print("as a colour:", colour, "as a number:", number)
assert (colour, number) == (0.25, 0.75)
END
