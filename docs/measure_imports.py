"""Measures what programs make of the lamps in glTF and USD files: `python docs/measure_imports.py
blender` (needs bpy and NumPy alone), `three` or `babylon` (as `drivers/browsers.py`, and
babylonjs-loaders) prints JSON.

A file has a lamp, a camera at the origin that looks along -z, and a matte wall of albedo 0.5 in
front of it, 5 from the lamp, or a wall that shines.  Its light is printed as a multiple of what a
lamp of as many W/sr (point, spot), W/m2 (directional) or W/sr/m2 (the others) makes of it.
"""

import base64
import json
import math
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).with_name("drivers")))

Array = npt.NDArray[Any]

N, ALBEDO, DISTANCE, HALF = 16, 0.5, 5.0, 20.0
RADIUS, SIDE, DEGREES = 0.05, 0.1, 0.53
BALL, SQUARE = math.pi * RADIUS**2, SIDE**2
SUN = math.pi * math.sin(math.radians(DEGREES / 2.0)) ** 2
CORNERS = [(-HALF, -HALF, -4.0), (HALF, -HALF, -4.0), (HALF, HALF, -4.0), (-HALF, HALF, -4.0)]
FACES = [0, 1, 2, 0, 2, 3]

GLTF: dict[str, dict[str, Any]] = {
    "point": {"type": "point", "intensity": 10.0},
    "spot": {"type": "spot", "intensity": 10.0, "spot": {"innerConeAngle": 0.3}},
    "directional": {"type": "directional", "intensity": 1.0},
    "emissive": {},
}
STRENGTH = 0.7

USD: dict[str, tuple[str, tuple[str, ...], float]] = {
    "sphere": ("SphereLight", (f"float inputs:radius = {RADIUS}",), BALL),
    "disk": ("DiskLight", (f"float inputs:radius = {RADIUS}",), BALL),
    "rect": (
        "RectLight",
        (f"float inputs:width = {SIDE}", f"float inputs:height = {SIDE}"),
        SQUARE,
    ),
    "distant": ("DistantLight", (f"float inputs:angle = {DEGREES}",), SUN * DISTANCE**2),
    "dome": ("DomeLight", ("color3f inputs:color = (1, 1, 1)",), math.pi * DISTANCE**2),
}
"""Types of lamps, what they have, and by how much W/sr their light on the wall is that of one, for
each of their number, as UsdLux's schemas say."""

MORE = {
    "": (),
    "normalize": ("bool inputs:normalize = 1",),
    "exposure 1": ("float inputs:exposure = 1",),
    "cone of 30 degrees": ("float inputs:shaping:cone:angle = 30",),
}
KINDS = [*USD, *(f"sphere, {more}" for more in MORE if more), "distant, normalize"]


def gltf(kind: str) -> str:
    """A file with this lamp, or with a wall that shines."""
    data = np.array(CORNERS, "<f4").tobytes() + np.array(4 * [(0, 0, 1)], "<f4").tobytes()
    data += np.array(FACES, "<u2").tobytes()
    views = [(0, 48), (48, 48), (96, 12)]
    look: dict[str, Any] = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*3 * [ALBEDO], 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
    }
    lamps = [GLTF[kind]]
    if kind == "emissive":
        lamps = []
        look["pbrMetallicRoughness"]["baseColorFactor"] = [0.0, 0.0, 0.0, 1.0]
        look["emissiveFactor"] = [1.0, 1.0, 1.0]
        look["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": STRENGTH}
    nodes: list[dict[str, Any]] = [{"mesh": 0, "name": "wall"}, {"camera": 0}]
    nodes += [
        {"translation": [0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}}
        for _ in lamps
    ]
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
    ]
    accessors[0] |= {"min": CORNERS[0], "max": CORNERS[2]}
    said = {
        "asset": {"version": "2.0"},
        "extensionsUsed": [
            "KHR_lights_punctual",
            "KHR_materials_specular",
            "KHR_materials_emissive_strength",
        ],
        "extensions": {"KHR_lights_punctual": {"lights": lamps}} if lamps else {},
        "buffers": [{"uri": uri, "byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": a, "byteLength": n} for a, n in views],
        "accessors": accessors,
        "materials": [look],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}
                ]
            }
        ],
        "cameras": [
            {
                "type": "perspective",
                "perspective": {"yfov": 0.7, "aspectRatio": 1.0, "znear": 0.1, "zfar": 100.0},
            }
        ],
        "nodes": nodes,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "scene": 0,
    }
    return json.dumps(said)


def usd(kind: str) -> str:
    """A file with this lamp."""
    name, _, more = kind.partition(", ")
    type_, own, _ = USD[name]
    lamp = (
        *own,
        *MORE[more],
        f"float inputs:intensity = {NUMBER[name]}",
        "double3 xformOp:translate = (0, 0, 1)",
        'uniform token[] xformOpOrder = ["xformOp:translate"]',
    )
    eye = (
        "float focalLength = 50",
        "float horizontalAperture = 36",
        "float verticalAperture = 36",
        "float2 clippingRange = (0.01, 100)",
    )
    wall = (
        "int[] faceVertexCounts = [4]",
        "int[] faceVertexIndices = [0, 1, 2, 3]",
        f"point3f[] points = {CORNERS}",
    )
    has = (("Camera", eye), ("Mesh", wall), (f"{type_}", lamp))
    said = '#usda 1.0\n(\n    upAxis = "Y"\n    metersPerUnit = 1\n)\n'
    for k, (what, fields) in enumerate(has):
        api = ' (prepend apiSchemas = ["ShapingAPI"])' if "cone" in more and k == 2 else ""
        said += f'def {what} "p{k}"{api}\n{{\n' + "".join(f"    {f}\n" for f in fields) + "}\n"
    return said


NUMBER = {**dict.fromkeys(USD, 1000.0), "dome": 1.0}


def blender(folder: Path) -> dict[str, float]:
    """Each format's, and glTF's by each of the importer's three modes."""
    import bpy  # type: ignore[import-not-found]

    def shown(read: Any, of_wall: bool) -> float:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        # Domes become the world's, if there is one.
        bpy.context.scene.world = bpy.data.worlds.new("w")
        bpy.context.scene.world.use_nodes = True
        bpy.context.scene.world.node_tree.nodes["Background"].inputs[1].default_value = 0.0
        read()
        made = bpy.context.scene
        made.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
        wall = next(o for o in bpy.data.objects if o.type == "MESH")
        if of_wall:
            matte = bpy.data.materials.new("matte")
            matte.use_nodes = True
            tree = matte.node_tree
            tree.nodes.clear()
            node = tree.nodes.new("ShaderNodeBsdfDiffuse")
            node.inputs["Color"].default_value = (*3 * [ALBEDO], 1.0)
            tree.links.new(
                node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"]
            )
            wall.data.materials.clear()
            wall.data.materials.append(matte)
        made.render.engine = "CYCLES"
        made.cycles.samples, made.cycles.use_adaptive_sampling = 1024, False
        made.cycles.use_denoising = False
        made.render.resolution_x = made.render.resolution_y = N
        made.render.resolution_percentage = 100
        made.render.image_settings.file_format = "OPEN_EXR"
        made.render.image_settings.color_depth = "32"
        made.render.filepath = str(folder / "s.exr")
        made.view_settings.view_transform = "Raw"
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(folder / "s.exr"))
        image.colorspace_settings.name = "Non-Color"
        values = np.array(image.pixels[:]).reshape(N, N, 4)[..., :3]
        bpy.data.images.remove(image)
        return middle(values)

    found = {}
    for kind in GLTF:
        file = folder / "s.gltf"
        file.write_text(gltf(kind), encoding="utf-8")
        for mode in ("SPEC", "COMPAT", "RAW"):

            def read(file: Path = file, mode: str = mode) -> None:
                bpy.ops.import_scene.gltf(
                    filepath=str(file), export_import_convert_lighting_mode=mode
                )

            found[f"glTF {kind}, {mode}"] = shown(read, kind != "emissive") / of_gltf(kind)
    for kind in KINDS:
        file = folder / "s.usda"
        file.write_text(usd(kind), encoding="utf-8")
        value = shown(lambda file=file: bpy.ops.wm.usd_import(filepath=str(file)), True)
        found[f"USD {kind}"] = value / of_usd(kind)
    return found


def middle(picture: Array) -> float:
    return float(np.median(picture[N // 2 - 1 : N // 2 + 1, N // 2 - 1 : N // 2 + 1]))


def of_gltf(kind: str) -> float:
    """What our lamp of the same number would make of the wall."""
    if kind == "emissive":
        return STRENGTH
    by = 1.0 if kind == "directional" else DISTANCE**-2.0
    return float(GLTF[kind]["intensity"]) * by * ALBEDO / math.pi


def of_usd(kind: str) -> float:
    name, _, more = kind.partition(", ")
    by = {"exposure 1": 2.0}.get(more, 1.0)
    if more == "normalize":
        by = 1.0 / (SUN if name == "distant" else 4.0 * BALL)
    return by * NUMBER[name] * USD[name][2] / DISTANCE**2 * ALBEDO / math.pi


def page_of(name: str, folder: Path) -> dict[str, float]:
    """glTF's lamps, by a page in the gate's browser."""
    from browsers import FILES, packages
    from playwright.sync_api import sync_playwright

    from comparisons.gate.browser import HOST, READY, launched, opened, rendered

    more = ("babylonjs-loaders",) if name == "babylon" else ()
    for part in (*FILES[name], *more):
        (folder / "packages" / part).parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(packages() / part, folder / "packages" / part)
    said = (Path(__file__).parent / "drivers" / f"{name}_gltf.html").read_text(encoding="utf-8")
    (folder / "page.html").write_text(said.replace("SIZE", str(N)), encoding="utf-8")
    found = {}
    with sync_playwright() as playwright:
        browser = launched(playwright.chromium)
        for kind in GLTF:
            (folder / "s.gltf").write_text(gltf(kind), encoding="utf-8")
            page = opened(browser, folder, None)
            page.on("console", lambda message: print(message.text, file=sys.stderr))
            page.goto(f"{HOST}/page.html")
            page.evaluate(READY)
            picture = rendered(page, {}, codes=False)
            found[f"glTF {kind}"] = middle(np.asarray(picture[..., :3], float)) / of_gltf(kind)
        browser.close()
    return found


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        (name,) = sys.argv[1:]
        found = blender(Path(made)) if name == "blender" else page_of(name, Path(made))
    print(json.dumps(found, indent=1), flush=True)
    os._exit(0)  # bpy need not be taken down
