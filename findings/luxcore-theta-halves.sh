#!/usr/bin/env bash
# LuxCore 2.11.2: an area lamp with `emission.power` becomes half as bright when `emission.theta`, 90 degrees, is reduced to
# 89.9: its power is divided by the area times pi at 90 degrees, and by the area times 2 pi (1 - cos theta) below that,
# which is the solid angle without the cosine. So 60 degrees are as bright as 90 are. With `gain` it does not change.
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
scene.camera.fieldofview = 20
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
SQUARE = square("q", 1, -1, "e")
found = {}
for theta in (90, 89.9, 60):
    power = "scene.materials.e.emission.power = 100\nscene.materials.e.emission.efficency = 1\n"
    angle = f"scene.materials.e.emission.theta = {theta:g}\n"
    found[theta] = [render(LAMP + given + angle + SQUARE)[8, 8] for given in (power, "")]
    print(f"theta {theta}: radiance {found[theta][0]:.4f} with power, {found[theta][1]:.4f} with gain")
assert abs(found[90][0] - 100 / (4 * np.pi)) < 1e-3
assert abs(found[89.9][0] / found[90][0] - 0.5) < 0.002
assert abs(found[60][0] / found[90][0] - 1) < 1e-4
assert all(abs(gain - 1) < 1e-4 for _, gain in found.values())
print("as described", flush=True)
os._exit(0)
END
"$work/venv/bin/python" check.py > out.log 2> err.log || { tail -5 err.log; exit 1; }
grep -E "^(rows|lamp|theta|as described)" out.log
grep -q "as described" out.log
