#!/usr/bin/env bash
# A lamp of an IES file with one horizontal angle shines the same all around, and one whose candelas are all equal shines the same to all
# sides. In Cycles (Blender 5.0.1; 4.5.15 alike) it does not: the node's interpolation is cubic, with neighbours of 0 where the table has
# none, so that between C = 0 and 360 degrees a table of equal numbers bulges by an eighth of itself, an even lamp has 8 % more light,
# and any lamp has too much beside C = 0. C runs clockwise seen from above, LM-63 and Radiance count counterclockwise: a lamp
# that shines to C = 90 lights the other side. And since 2019 the second number of the ballast's line is no factor but the kind
# of the measurement, 1.1 for one of an accredited laboratory, which makes such a lamp 10 % brighter. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3.11 -m venv venv
venv/bin/pip install -q --disable-pip-version-check bpy==5.0.1
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


even = ies("even.ies", [0], [[500] * 4])
# Each cell of this table is as narrow as a degree, and flat beside it.
fine = ies("fine.ies", range(361), [[500] * 4] * 361)
base = lit(fine, (-1, 0.3, -0.05))
around = [lit(even, (math.cos(a), math.sin(a), -0.05)) / base for a in (0.3, 1.1, 1.9, 2.7, 3.5, 4.3, 5.1, 5.9)]
print("500 cd to all sides, around the horizon:", *(f"{x:.3f}" for x in around), file=answers)
lobe = ies("lobe.ies", [0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330, 360], [[100, 900, 900, 100] if k == 3 else [100] * 4 for k in range(13)])
sides = {name: lit(lobe, d) / base * 5.0 for name, d in {"+x": (1, 0, 0), "+y": (0, 1, 0), "-x": (-1, 0, 0), "-y": (0, -1, 0)}.items()}
print("900 cd to C = 90, 100 to others:", *(f"{name} {x:.2f}" for name, x in sides.items()), file=answers)
start = ies("start.ies", [0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330, 360], [[100, 900, 900, 100] if k in (0, 12) else [100] * 4 for k in range(13)])
zero = {name: lit(start, d) / base * 5.0 for name, d in {"+x": (1, 0, 0), "+y": (0, 1, 0), "-x": (-1, 0, 0), "-y": (0, -1, 0)}.items()}
print("900 cd to C = 0, 100 to others:", *(f"{name} {x:.2f}" for name, x in zero.items()), file=answers)
kind = lit(ies("kind.ies", [0], [[500] * 4], "IES:LM-63-2019", 1.1), (1, 0.3, -0.1)) / lit(even, (1, 0.3, -0.1))
print(f"LM-63-2019, measured by an accredited laboratory: {kind:.3f}", file=answers)
answers.flush()
good = max(around) > 1.12 and abs(kind - 1.1) < 1e-3
good &= max(zero, key=zero.get) == "-y" and max(sides, key=sides.get) == "-x"  # counterclockwise from -y is +x
sys.exit(0 if good else 1)
END
venv/bin/python lamps.py
