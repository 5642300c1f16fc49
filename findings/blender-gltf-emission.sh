#!/usr/bin/env bash
# In a glTF file lamps have candela or lux, and emission has nits, so that a lamp and a shining surface have one ratio. Blender 5.0.1's
# importer divides lamps by 683 lm/W and emission by nothing: the same surface is 683 times as bright beside the same lamp as in
# three.js and Babylon.js, which keep both. Its mode "Unitless" keeps both, too; "Raw" divides points by 4 pi, suns by nothing.
# Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3.11 -m venv venv
venv/bin/pip install -q --disable-pip-version-check bpy==5.0.1
cat > lamp.py <<'END'
import base64
import json
import math
import os
import sys

import bpy
import numpy as np

answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

points = np.array([(-9, -9, -4), (0, -9, -4), (0, 9, -4), (0, -9, -4), (9, -9, -4), (9, 9, -4)], "<f4")
points = np.concatenate([points[:3], [points[0], points[2], (-9, 9, -4)], points[3:], [points[3], points[5], (0, 9, -4)]])
data = points.astype("<f4").tobytes()
file = {
    "asset": {"version": "2.0"},
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 25 * math.pi}]}},
    "buffers": [{"uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(), "byteLength": len(data)}],
    "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
    "accessors": [
        {"bufferView": 0, "byteOffset": 72 * k, "componentType": 5126, "count": 6, "type": "VEC3",
         "min": points[6 * k : 6 * k + 6].min(0).tolist(), "max": points[6 * k : 6 * k + 6].max(0).tolist()}
        for k in range(2)
    ],
    "materials": [
        {"pbrMetallicRoughness": {"metallicFactor": 0}},
        {"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}, "emissiveFactor": [1, 1, 1]},
    ],
    "meshes": [{"primitives": [{"attributes": {"POSITION": k}, "material": k}]} for k in range(2)],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1, "znear": 0.1}}],
    "nodes": [{"mesh": 0}, {"mesh": 1}, {"camera": 0}, {"translation": [0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
    "scenes": [{"nodes": [0, 1, 2, 3]}],
}
with open("lamp.gltf", "w") as out:
    json.dump(file, out)


def halves(mode):
    """Beside the middle: a white matte wall by the lamp, and the wall that shines."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=os.path.abspath("lamp.gltf"), export_import_convert_lighting_mode=mode)
    scene = bpy.context.scene
    scene.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
    white = bpy.data.materials.new("white")
    white.use_nodes = True
    white.node_tree.nodes.clear()
    matte = white.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
    matte.inputs["Color"].default_value = (1.0,) * 4
    white.node_tree.links.new(matte.outputs[0], white.node_tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    lit = min((o for o in bpy.data.objects if o.type == "MESH"), key=lambda o: min(v.co[0] for v in o.data.vertices))
    lit.data.materials.clear()
    lit.data.materials.append(white)
    scene.render.engine, scene.cycles.samples, scene.cycles.max_bounces = "CYCLES", 256, 0
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.view_settings.view_transform = "Raw"
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = os.path.abspath("lamp.exr")
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    picture.colorspace_settings.name = "Non-Color"
    row = np.array(picture.pixels[:]).reshape(16, 16, -1)[7:9, :, 0].mean(0)
    return float(row[6]), float(row[9])


seen = {mode: halves(mode) for mode in ("SPEC", "COMPAT", "RAW")}
for mode, (lit, shining) in seen.items():
    print(f"{mode}: the lit wall {lit:.6f}, the shining one {shining:.6f}; by the file's numbers 1 and 1", file=answers)
answers.flush()
expected = {"SPEC": 1.0 / 683.0, "COMPAT": 1.0, "RAW": 0.25 / math.pi}
good = all(abs(seen[m][0] / expected[m] - 1.0) < 0.03 and abs(seen[m][1] - 1.0) < 0.01 for m in seen)
os._exit(0 if good else 1)
END
venv/bin/python lamp.py
