"""Cycles in a process of its own: renders replicates of a scene of plain data.

This file runs in a Python that has Blender, whose NumPy is another one than ours: it imports
nothing of this package.  It keeps to the protocol of `comparisons.runs.processes`: a request

    {"scene": "folder", "seed": 3, "spp": 64, "out": "picture.npy"}

renders `folder/scene.json`, as `translate` writes it, into an array (height, width, 3) of linear
radiance, and `picture.npy.json` with the seconds.
"""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import bpy  # type: ignore[import-not-found]
import mathutils  # type: ignore[import-not-found]
import numpy as np

# ---- materials -----------------------------------------------------------------------------------


class Graph:
    """The shader nodes of one material or of the world."""

    def __init__(self, tree: Any, folder: Path) -> None:
        tree.nodes.clear()
        self.tree, self.folder = tree, folder

    def node(self, kind: str, inputs: Any = (), **settings: Any) -> Any:
        """A node with settings, and its inputs by name or number: values or other sockets."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        for name, value in dict(inputs).items():
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[name])
            else:
                node.inputs[name].default_value = value
        return node

    def math(self, operation: str, *values: Any) -> Any:
        return self.node("ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]

    def colour(self, value: Any) -> Any:
        """A colour: three numbers, or a texture."""
        if isinstance(value, dict):
            return getattr(self, value["type"])(**{k: v for k, v in value.items() if k != "type"})
        return (*value, 1.0)

    def number(self, value: Any) -> Any:
        return self.colour(value) if isinstance(value, dict) else value

    # Textures: their coordinates are u = U + c and so on, with the rows of `uv`.

    def _uv(self, uv: Any) -> Any:
        layer = self.node("ShaderNodeUVMap", uv_map="uv").outputs[0]
        parts = self.node("ShaderNodeSeparateXYZ", {0: layer}).outputs
        return [
            self.math("MULTIPLY_ADD", parts[0], a, self.math("MULTIPLY_ADD", parts[1], b, c))
            for a, b, c in uv
        ]

    def checker(self, uv: Any, first: Any, second: Any) -> Any:
        """The second colour where u and v are in different halves of their unit intervals."""
        halves = [
            self.math("GREATER_THAN", self.math("FRACT", coordinate), 0.5)
            for coordinate in self._uv(uv)
        ]
        mixed = self.math("ABSOLUTE", self.math("SUBTRACT", *halves))
        inputs = {"Factor": mixed, 6: (*first, 1.0), 7: (*second, 1.0)}
        return self.node("ShaderNodeMix", inputs, data_type="RGBA").outputs[2]

    def image(self, uv: Any, file: str, interpolation: str, extension: str) -> Any:
        values = np.load(self.folder / file)  # (h, w, 3), row 0 at the top
        h, w = values.shape[:2]
        image = bpy.data.images.new(file, w, h, alpha=False, float_buffer=True, is_data=True)
        pixels = np.ones((h, w, 4), np.float32)
        pixels[..., :3] = values[::-1]
        image.pixels.foreach_set(pixels.ravel())
        image.update()
        u, v = self._uv(uv)
        place = self.node("ShaderNodeCombineXYZ", {0: u, 1: v}).outputs[0]
        node = self.node(
            "ShaderNodeTexImage", {0: place}, interpolation=interpolation, extension=extension
        )
        node.image = image
        return node.outputs[0]

    # Media: coefficients of all parts add up.

    def volume(self, parts: Any) -> Any:
        found = None
        for part in parts:
            node = self.node("ShaderNodeVolumeCoefficients", phase=part["phase"])
            node.inputs["Absorption Coefficients"].default_value = part["absorption"]
            node.inputs["Scatter Coefficients"].default_value = part["scatter"]
            if part["g"] is not None:
                node.inputs["Anisotropy"].default_value = part["g"]
            one = node.outputs[0]
            found = one if found is None else self._added(found, one)
        return found

    # Materials: a shader, or None for black.

    def shader(self, value: Any) -> Any:
        return getattr(self, value["type"])(**{k: v for k, v in value.items() if k != "type"})

    def black(self) -> Any:
        return None

    def clear(self) -> Any:
        """Of what is no surface, and bounds no volume."""
        return self.node("ShaderNodeBsdfTransparent", {0: (1.0,) * 4}).outputs[0]

    def diffuse(self, colour: Any) -> Any:
        inputs = {"Color": self.colour(colour), "Roughness": 0.0}
        return self.node("ShaderNodeBsdfDiffuse", inputs).outputs[0]

    def glossy(self, colour: Any) -> Any:
        inputs = {"Color": self.colour(colour), "Roughness": 0.0}
        return self.node("ShaderNodeBsdfAnisotropic", inputs, distribution="GGX").outputs[0]

    def metal(self, eta: Any, k: Any, roughness: Any) -> Any:
        inputs = {"IOR": eta, "Extinction": k, "Roughness": self.number(roughness)}
        settings = {"fresnel_type": "PHYSICAL_CONDUCTOR", "distribution": "GGX"}
        return self.node("ShaderNodeBsdfMetallic", inputs, **settings).outputs[0]

    def glass(self, ior: float, roughness: Any) -> Any:
        inputs = {"Color": (1.0,) * 4, "IOR": ior, "Roughness": self.number(roughness)}
        return self.node("ShaderNodeBsdfGlass", inputs, distribution="GGX").outputs[0]

    def emission(self, radiance: Any) -> Any:
        strength = max(max(radiance), 1e-30)
        inputs = {"Color": [x / strength for x in radiance] + [1.0], "Strength": strength}
        return self.node("ShaderNodeEmission", inputs).outputs[0]

    def sum(self, of: Any) -> Any:
        a, b = (self.shader(one) for one in of)
        if a is None or b is None:
            return a or b
        return self._added(a, b)

    def _added(self, a: Any, b: Any) -> Any:
        return self.node("ShaderNodeAddShader", {0: a, 1: b}).outputs[0]

    def mix(self, weight: Any, first: Any, second: Any) -> Any:
        return self._mix(self.number(weight), self.shader(first), self.shader(second))

    def sides(self, front: Any, back: Any) -> Any:
        facing = self.node("ShaderNodeNewGeometry").outputs["Backfacing"]
        return self._mix(facing, self.shader(front), self.shader(back))

    def _mix(self, weight: Any, first: Any, second: Any) -> Any:
        inputs = {0: weight, 1: first, 2: second}
        inputs = {k: v for k, v in inputs.items() if v is not None}
        return self.node("ShaderNodeMixShader", inputs).outputs[0]


def material(name: str, value: Any, folder: Path) -> Any:
    found = bpy.data.materials.new(name)
    found.use_nodes = True
    found.cycles.emission_sampling = value["sampling"]
    graph = Graph(found.node_tree, folder)
    output, shader = graph.node("ShaderNodeOutputMaterial"), value["shader"]
    if value["volume"] is not None:
        graph.tree.links.new(graph.volume(value["volume"]), output.inputs["Volume"])
    # A volume without a surface is no edge of a path.
    if value["volume"] is None or shader["type"] != "clear":
        surface = graph.shader(shader)
        if surface is not None:
            graph.tree.links.new(surface, output.inputs["Surface"])
    return found


# ---- the scene -----------------------------------------------------------------------------------


def mesh(name: str, file: Path) -> Any:
    arrays = np.load(file)
    vertices, faces = arrays["vertices"], arrays["faces"]
    data = bpy.data.meshes.new(name)
    data.vertices.add(len(vertices))
    data.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    data.loops.add(3 * len(faces))
    data.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    data.polygons.add(len(faces))
    data.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    is_smooth = "normals" in arrays
    data.polygons.foreach_set("use_smooth", np.full(len(faces), is_smooth))
    if "uv" in arrays:
        layer = data.uv_layers.new(name="uv")
        layer.uv.foreach_set("vector", arrays["uv"].astype(np.float32).ravel())
    data.update()
    if is_smooth:
        attribute = data.attributes.new("custom_normal", "FLOAT_VECTOR", "CORNER")
        attribute.data.foreach_set("vector", arrays["normals"].astype(np.float32).ravel())
    return data


def objects(values: Any, materials: Any, folder: Path) -> None:
    """The meshes of a scene: those of one file and material are stored once."""
    origin = bpy.data.objects.new("origin", None)
    bpy.context.collection.objects.link(origin)
    made: dict[tuple[str, str], Any] = {}
    for k, value in enumerate(values):
        key = value["file"], value["material"]
        if key not in made:
            made[key] = mesh(f"mesh {k}", folder / value["file"])
            made[key].materials.append(materials[value["material"]])
        found = bpy.data.objects.new(f"object {k}", made[key])
        if "matrix" in value:
            # An object's own matrix has no shear; that of its parent may.
            found.parent, found.matrix_parent_inverse = origin, matrix(value["matrix"])
        found.cycles.shadow_terminator_geometry_offset = 0.0
        found.cycles.shadow_terminator_offset = 0.0
        bpy.context.collection.objects.link(found)


def light(name: str, value: Any) -> None:
    data = bpy.data.lights.new(name, value["type"])
    if value["type"] == "SUN":
        data.angle = 0.0
    else:
        data.shadow_soft_size = 0.0
    strength = max(max(value["colour"]), 1e-30)
    data.color = [x / strength for x in value["colour"]]
    data.energy = strength
    data.cycles.max_bounces = 1024
    found = bpy.data.objects.new(name, data)
    found.matrix_world = matrix(value["matrix"])
    bpy.context.collection.objects.link(found)


def matrix(rows: Any) -> Any:
    return mathutils.Matrix([*rows, (0.0, 0.0, 0.0, 1.0)])


def camera(value: Any, scene: Any) -> None:
    data = bpy.data.cameras.new("camera")
    data.type = value["type"]
    data.sensor_fit = "HORIZONTAL"
    if value["type"] == "ORTHO":
        data.ortho_scale = value["width"]
    else:
        data.sensor_width = 100.0
        data.lens = data.sensor_width / value["width"]  # width: at distance 1
    data.shift_x, data.shift_y = value["shift"]
    data.clip_start, data.clip_end = value["clip"]
    if value["aperture"] > 0.0:
        data.dof.use_dof = True
        data.dof.focus_distance = value["focus"]
        data.dof.aperture_fstop = data.lens * 1e-3 / (2.0 * value["aperture"])
    found = bpy.data.objects.new("camera", data)
    found.matrix_world = matrix(value["matrix"])
    bpy.context.collection.objects.link(found)
    scene.camera = found
    render = scene.render
    render.resolution_x, render.resolution_y = value["resolution"]
    render.resolution_percentage = 100
    aspect = value["aspect"]
    render.pixel_aspect_x, render.pixel_aspect_y = max(aspect, 1.0), max(1.0 / aspect, 1.0)


def build(folder: Path) -> None:
    value = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = (
        0.0
    )
    cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    for kind in ("", "diffuse_", "glossy_", "transmission_", "volume_"):
        setattr(cycles, f"{kind}max_bounces" if kind == "" else f"{kind}bounces", value["bounces"])
    cycles.transparent_max_bounces = 1024
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    scene.view_settings.view_transform = "Raw"
    scene.render.film_transparent = False
    scene.render.threads_mode = "FIXED" if value["threads"] else "AUTO"
    if value["threads"]:
        scene.render.threads = value["threads"]
    scene.render.use_persistent_data = True
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    settings.exr_codec = "NONE"
    materials = {name: material(name, m, folder) for name, m in value["materials"].items()}
    objects(value["meshes"], materials, folder)
    for k, one in enumerate(value["lights"]):
        light(f"light {k}", one)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    graph = Graph(scene.world.node_tree, folder)
    strength = max(max(value["background"]), 1e-30)
    colour = [x / strength for x in value["background"]] + [1.0]
    shader = graph.node("ShaderNodeBackground", {"Color": colour, "Strength": strength}).outputs[0]
    output = graph.node("ShaderNodeOutputWorld", {"Surface": shader})
    if value["volume"] is not None:
        graph.tree.links.new(graph.volume(value["volume"]), output.inputs["Volume"])
    camera(value["camera"], scene)


def render(seed: int, spp: int, out: str) -> None:
    scene = bpy.context.scene
    scene.cycles.seed = seed
    # Sample 0 of each pixel lies at its centre: a bias in proportion to 1 / spp.
    scene.cycles.samples = spp
    scene.cycles.use_sample_subset = True
    scene.cycles.sample_offset, scene.cycles.sample_subset_length = 1, spp
    path = out + ".exr"
    scene.render.filepath = path
    begin = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    seconds = time.perf_counter() - begin
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    w, h = image.size
    pixels = np.empty(w * h * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    np.save(out, pixels.reshape(h, w, image.channels)[::-1, :, :3])
    bpy.data.images.remove(image)
    Path(path).unlink()
    Path(out + ".json").write_text(json.dumps({"seconds": seconds}), encoding="utf-8")


def main() -> None:
    # Blender prints to descriptor 1: answers get one of their own.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    built = None
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if request["scene"] != built:
                built = None
                build(Path(request["scene"]))
                built = request["scene"]
            render(request["seed"], request["spp"], request["out"])
            answer: dict[str, Any] = {"done": True}
        except Exception as error:  # of this request: the next one may succeed
            answer = {"failed": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
