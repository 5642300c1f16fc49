#!/usr/bin/env bash
# LuxCore 2.11.2: `gain = 1 1 1` of a lamp, without power, is four quantities. Of `spot` it is radiant intensity, of `point`
# the power, so that a point is 4 pi times darker than a spot of the same number; of `sharpdistant` it is irradiance, of
# `distant` the radiance of its disk, so that a narrower sun of the same number lights less, by sin^2 theta.
# A matte wall of albedo 0.5, 3 away, faces the lamp. Seen on 2026-11-29.
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
scene.camera.fieldofview = 4
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


WALL = "scene.materials.w.type = matte\nscene.materials.w.kd = 0.5 0.5 0.5\n" + square("wall", 20, -4, "w")
PLACE = "position = 0 0 -1"
LAMPS = {
    "point": (PLACE, 1 / 9 / (4 * np.pi)),
    "spot": (f"{PLACE}|target = 0 0 -4|coneangle = 30|conedeltaangle = 5", 1 / 9),
    "sharpdistant": ("direction = 0 0 -1", 1.0),
    "distant": ("direction = 0 0 -1|theta = 10", np.pi * np.sin(np.radians(10)) ** 2),
    "distant ": ("direction = 0 0 -1|theta = 5", np.pi * np.sin(np.radians(5)) ** 2),
}
for kind, (fields, expected) in LAMPS.items():
    lines = [f"type = {kind.strip()}", "gain = 1 1 1", *fields.split("|")]
    text = "\n".join(f"scene.lights.l.{line}" for line in lines)
    irradiance = render(f"{WALL}{text}\n", spp=256)[8:10, 7:9].mean() * np.pi / 0.5
    print(f"lamp {kind.strip()}: irradiance {irradiance:.5f}, by this reading {expected:.5f}  ({fields})")
    assert abs(irradiance / expected - 1) < 0.01
print("as described", flush=True)
os._exit(0)
END
"$work/venv/bin/python" check.py > out.log 2> err.log || { tail -5 err.log; exit 1; }
grep -E "^(rows|lamp|theta|as described)" out.log
grep -q "as described" out.log
