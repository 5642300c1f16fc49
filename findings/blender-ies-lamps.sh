#!/usr/bin/env bash
# Lamps of IES files in Cycles. Their horizontal angles run clockwise seen from above, where LM-63 and Radiance count counterclockwise:
# one that shines to C = 90 lights the other side. Since 1995 the second number of the ballast's line is no factor, and since 2019
# it is the kind of the measurement, 1.1 for one of an accredited laboratory: such lamps are 10 % brighter. (Blender 5.0.1 and
# 4.5.15.) In 4.5.15, the LTS, a lamp of 500 cd to all sides has up to 562: its interpolation is cubic, with 0 for the neighbours
# that the angles 0 and 360 do not have, so that a table with one row bulges by an eighth opposite to C = 0; 5.0.1 does not.
# Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > lamps.py <<'END'
import math
import os
import sys

import bpy
from mathutils import Vector

answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)


def ies(name, horizontal, rows, heading="IESNA:LM-63-2002", kind=1):
    """A file with vertical angles 0, 60, 120, 180."""
    with open(name, "w") as file:
        print(f"{heading}\n[TEST] 1\n[TESTLAB] none\n[ISSUEDATE] 1-JAN-2020\n[MANUFAC] none\nTILT=NONE", file=file)
        print(f"1 -1 1 4 {len(rows)} 1 2 0 0 0\n1 {kind} 10\n0 60 120 180", file=file)
        for row in (horizontal, *rows):
            print(*row, file=file)
    return os.path.abspath(name)


def lit(name, direction):
    """Light that a lamp, whose nadir is -z, sends into a direction: of a matte wall across it, seen from the lamp."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine, cycles = "CYCLES", scene.cycles
    cycles.device, cycles.samples, cycles.max_bounces = "CPU", 1, 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 1
    scene.view_settings.view_transform = "Raw"
    image = scene.render.image_settings
    image.file_format, image.color_depth = "OPEN_EXR", "32"
    d = Vector(direction).normalized()
    turn = d.to_track_quat("-Z", "Y").to_euler()
    wall = bpy.data.materials.new("wall")
    wall.use_nodes = True
    nodes, link = wall.node_tree.nodes, wall.node_tree.links.new
    nodes.clear()
    matte, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    link(matte.outputs[0], output.inputs[0])
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=d, rotation=turn)
    bpy.context.object.data.materials.append(wall)
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.shadow_soft_size, lamp.energy, lamp.use_nodes = 0.0, 100.0, True
    table = lamp.node_tree.nodes.new("ShaderNodeTexIES")
    table.mode, table.filepath = "EXTERNAL", name
    emission = next(node for node in lamp.node_tree.nodes if node.type == "EMISSION")
    lamp.node_tree.links.new(table.outputs[0], emission.inputs["Strength"])
    scene.collection.objects.link(bpy.data.objects.new("lamp", lamp))
    bpy.ops.object.camera_add(rotation=turn)
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1e-4
    scene.render.filepath = os.path.join(os.getcwd(), "wall.exr")
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    picture.colorspace_settings.name = "Non-Color"
    return picture.pixels[0]


ROUND = range(0, 361, 30)
SIDES = {"+x": (1, 0, 0), "-y": (0, -1, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0)}
"""Clockwise seen from above, from +x."""


def sides(name):
    return {side: lit(name, d) for side, d in SIDES.items()}


even = ies("even.ies", [0], [[500] * 4])
fine = lit(ies("fine.ies", range(361), [[500] * 4] * 361), (-1, 0.3, -0.05))  # cells that are flat, and narrow
around = [lit(even, (math.cos(a), math.sin(a), -0.05)) / fine for a in (0.3, 1.1, 1.9, 2.7, 3.5, 4.3, 5.1, 5.9)]
print("1 to all sides, around the horizon:", *(f"{x:.3f}" for x in around), file=answers)
found = []
for c in (0, 90):
    values = sides(ies(f"{c}.ies", ROUND, [[100, 900, 900, 100] if k % 360 == c else [100] * 4 for k in ROUND]))
    found.append(max(values, key=values.get))
    print(f"a lobe to C = {c} shines to {found[-1]}", file=answers)
quarters = ([*SIDES].index(found[1]) - [*SIDES].index(found[0])) % 4
print("C runs", {1: "clockwise", 3: "counterclockwise"}.get(quarters), "seen from above", file=answers)
kind = lit(ies("kind.ies", [0], [[500] * 4], "IES:LM-63-2019", 1.1), (1, 0.3, -0.1)) / lit(even, (1, 0.3, -0.1))
print(f"measured by an accredited laboratory: {kind:.3f} times as bright", file=answers)
answers.flush()
bulge = max(around) > 1.12 if bpy.app.version < (5, 0) else max(around) < 1.001
sys.exit(0 if bulge and quarters == 1 and abs(kind - 1.1) < 1e-3 else 1)
END
for version in 5.0.1 4.5.15; do
    python3.11 -m venv "venv-$version"
    "venv-$version/bin/pip" install -q --disable-pip-version-check "bpy==$version"
    echo "Blender $version"
    "venv-$version/bin/python" lamps.py
done
