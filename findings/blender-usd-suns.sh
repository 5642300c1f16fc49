#!/usr/bin/env bash
# Blender 5.0.1's USD importer makes a DistantLight 16 times as bright as UsdLux says: `inputs:angle`, the angle across its disc, is
# taken for the half of it, so that the disc is twice as wide and 4 times as large, and the strength is 4 times `inputs:intensity`.
# A light of intensity L and angle a gives a wall across its direction L pi sin^2(a/2), or L with `inputs:normalize`, of which 4 L
# are seen. Spheres, discs, rectangles and domes of intensity L shine with L as they should. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3.11 -m venv venv
venv/bin/pip install -q --disable-pip-version-check bpy==5.0.1
cat > sun.py <<'END'
import math
import os
import sys

import bpy
import numpy as np

answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

FILE = """#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
)
def Camera "eye"
{{
    float focalLength = 50
    float horizontalAperture = 36
    float verticalAperture = 36
    float2 clippingRange = (0.01, 100)
}}
def Mesh "wall"
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, -9, -4), (9, -9, -4), (9, 9, -4), (-9, 9, -4)]
}}
def DistantLight "sun"
{{
    float inputs:angle = {angle}
    float inputs:intensity = 100
    bool inputs:normalize = {normalize}
}}
"""


def irradiance(angle, normalize):
    """Of a white matte wall across the sun's direction, over the intensity."""
    with open("sun.usda", "w") as file:
        file.write(FILE.format(angle=angle, normalize=int(normalize)))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=os.path.abspath("sun.usda"))
    scene = bpy.context.scene
    scene.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
    wall = next(o for o in bpy.data.objects if o.type == "MESH").data
    white = bpy.data.materials.new("white")
    white.use_nodes = True
    white.node_tree.nodes.clear()
    matte = white.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
    matte.inputs["Color"].default_value = (1.0,) * 4
    out = white.node_tree.nodes.new("ShaderNodeOutputMaterial")
    white.node_tree.links.new(matte.outputs[0], out.inputs[0])
    wall.materials.clear()
    wall.materials.append(white)
    scene.render.engine, scene.cycles.samples = "CYCLES", 256
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.view_settings.view_transform = "Raw"
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = os.path.abspath("sun.exr")
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    picture.colorspace_settings.name = "Non-Color"
    return math.pi * float(np.mean(np.array(picture.pixels[:]).reshape(64, -1)[:, :3])) / 100.0


factors = []
for angle in (0.53, 5.0):
    for normalize in (False, True):
        expected = 1.0 if normalize else math.pi * math.sin(math.radians(angle / 2.0)) ** 2
        factors.append(irradiance(angle, normalize) / expected)
        print(f"angle {angle}, normalize {normalize}: {factors[-1]:.3f} of what the schema says", file=answers)
answers.flush()
os._exit(0 if np.allclose(factors, [16.0, 4.0] * 2, rtol=0.02) else 1)
END
venv/bin/python sun.py
