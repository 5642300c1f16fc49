#!/usr/bin/env bash
# LuxCore 2.11.2 renders what a camera sees exactly one pixel too low, with any filter, in memory and in files: a shining
# square that fills the middle 8 of 16 pixels lights rows 5 to 12 from the top, not 4 to 11, and columns 4 to 11.
# Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check pyluxcore==2.11.2 numpy==2.4.6
cd "$work"
cat > check.py <<'END'
import os
import time

import numpy as np
import pyluxcore

pyluxcore.Init(lambda line: None)
CAMERA = """
scene.camera.lookat.orig = 0 0 0
scene.camera.lookat.target = 0 0 -1
scene.camera.up = 0 1 0
scene.camera.fieldofview = 90
"""


def square(name, half, z, material):
    x, z = f"{half:g}", f"{z:g}"
    corners = f"-{x} -{x} {z} {x} -{x} {z} {x} {x} {z} -{x} {x} {z}"
    return f"""
scene.shapes.{name}.type = inlinedmesh
scene.shapes.{name}.vertices = {corners}
scene.shapes.{name}.faces = 0 1 2 0 2 3
scene.objects.{name}.shape = {name}
scene.objects.{name}.material = {material}
"""


def render(text, filter_="NONE", spp=64):
    """The picture (16, 16), the top row first."""
    scene, given = pyluxcore.Scene(), pyluxcore.Properties()
    given.SetFromString(CAMERA + text)
    scene.Parse(given)
    config = pyluxcore.Properties()
    config.SetFromString(f"""
renderengine.type = PATHCPU
sampler.type = SOBOL
film.width = 16
film.height = 16
film.filter.type = {filter_}
film.outputs.1.type = RGB
film.outputs.1.filename = out.exr
batch.haltspp = {spp}
""")
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config, scene))
    session.Start()
    while not session.HasDone():
        time.sleep(0.05)
        session.UpdateStats()
    session.Stop()
    values = np.zeros(16 * 16 * 3, np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, values, 0)
    return values.reshape(16, 16, 3)[::-1, :, 1].astype(float)  # it has the bottom row first


LAMP = "scene.materials.e.type = matte\nscene.materials.e.kd = 0 0 0\nscene.materials.e.emission = 1 1 1\n"
for name in ("NONE", "BLACKMANHARRIS"):
    lit = render(LAMP + square("q", 0.5, -1, "e"), name) > 0.5
    rows, columns = (np.flatnonzero(lit.any(axis=k)) for k in (1, 0))
    print(f"rows {rows[0]} to {rows[-1]} of 0 to 15 from the top, columns {columns[0]} to {columns[-1]}: filter {name}")
    assert (rows[0], rows[-1], columns[0], columns[-1]) == (5, 12, 4, 11)
print("as described", flush=True)
os._exit(0)
END
"$work/venv/bin/python" check.py > out.log 2> err.log || { tail -5 err.log; exit 1; }
grep -E "^(rows|lamp|theta|as described)" out.log
grep -q "as described" out.log
