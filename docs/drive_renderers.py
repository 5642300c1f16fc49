"""Draws a small scene by another renderer: what the two `measure_` scripts of renderers share.

`python docs/drive_renderers.py NAME scene.json out.npy SEEDS SPP` writes (seeds, height, width, 3)
as the renderer gives it, unturned.  The scene is one of ours, of few words: a camera at the origin
that looks along -z with `fov` across, spheres, and rectangles and boxes with a `matrix` each; the
materials and lights of `words`.  Numbers of lights are copied as they stand.

It needs NumPy and the renderer: tachyon and POV-Ray by apt, bpy, pyluxcore, pyradiance, raysect and
mitsuba by pip in the environment that runs it, since some exclude others.  `drive_browsers` has
three.js and Babylon.js.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Words = dict[str, Any]

SMALL, SUN = 1e-3, 0.05
"""Radius of the balls that stand for points, and degrees across the disc that stands for parallel
light, where a renderer has neither."""

NEAR = 1e-3
"""POV-Ray's `fade_distance`, below which its points do not fade."""


class HasNoneError(Exception):
    """The renderer lacks a word of the scene."""


def rgb(value: Any) -> tuple[float, float, float]:
    r, g, b = np.broadcast_to(np.asarray(value, float), 3).tolist()
    return r, g, b


def text(values: Any) -> str:
    return " ".join(f"{v:.9g}" for v in np.ravel(values))


def commas(values: Any) -> str:
    return f"<{', '.join(f'{v:.12g}' for v in np.ravel(values))}>"


def size(scene: Words) -> tuple[int, int, float, float]:
    """Pixels, and half the view at distance 1, across and up."""
    width, height = scene["film"]["width"], scene["film"]["height"]
    half = math.tan(math.radians(scene["camera"]["fov"] / 2.0))
    return width, height, half, half * height / width


def longer(scene: Words) -> float:
    """Degrees along the longer side."""
    _, _, x, y = size(scene)
    return 2.0 * math.degrees(math.atan(max(x, y)))


def placed(shape: Words) -> Array:
    """(4, 4): from the square or the cube of side 2 to the scene."""
    (step,) = shape["transform"]
    return np.vstack([np.array(step["matrix"], float), [0.0, 0.0, 0.0, 1.0]])


FACES = [[[x, -1, -1], [x, x, -x], [x, 1, 1], [x, -x, x]] for x in (-1, 1)]
CUBE = np.array([np.roll(face, turn, axis=1) for face in FACES for turn in range(3)], float)
"""(6, 4, 3): corners of the cube's faces, counter-clockwise from outside."""
SQUARE = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]], float)


def quads(shape: Words) -> Array:
    """(n, 4, 3): a rectangle's or a box's."""
    matrix = placed(shape)
    corners = CUBE if shape["type"] == "box" else SQUARE
    return np.asarray(corners @ matrix[:3, :3].T + matrix[:3, 3])


def mesh(shape: Words, n: int = 128) -> tuple[Array, Array, Array | None]:
    """Corners, triangles, and normals where they are smooth, for renderers that have no others."""
    if shape["type"] != "sphere":
        corners = quads(shape)
        first = 4 * np.arange(len(corners))[:, None]
        both = [first + [0, 1, 2], first + [0, 2, 3]]
        return corners.reshape(-1, 3), np.concatenate(both), None
    theta, phi = np.linspace(0.0, math.pi, n + 1), np.arange(2 * n) * math.pi / n
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1)
    unit = unit.reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij")
    a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
    upper, lower = np.stack([a, b, a + 2 * n], -1)[1:], np.stack([b, b + 2 * n, a + 2 * n], -1)[:-1]
    faces = np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)])
    return unit * shape["radius"] + shape["center"], faces, unit


def inside(scene: Words) -> bool:
    """Whether the eye is inside of a ball."""
    balls = [shape for shape in scene["shapes"] if shape["type"] == "sphere"]
    return any(math.dist((0, 0, 0), ball["center"]) < ball["radius"] for ball in balls)


def look(scene: Words, shape: Words) -> tuple[str, Words]:
    material = scene["materials"][shape["material"]]
    return str(material["type"]), material


def lights(scene: Words) -> list[tuple[str, Words]]:
    return [(str(light["type"]), light) for light in scene.get("lights", [])]


def words(name: str, table: dict[str, Any], what: str) -> Any:
    if what not in table:
        raise HasNoneError(f"{name} has no {what}")
    return table[what]


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{command[0]}: {(done.stdout + done.stderr)[-800:]}")
    return done.stdout


def ppm16(file: Path, width: int, height: int) -> Array:
    """The last picture of 16 bits of a PPM file."""
    data = file.read_bytes()[-6 * width * height :]
    return np.frombuffer(data, ">u2").reshape(height, width, 3) / 65535.0


def tachyon(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    width, height, _, y = size(scene)
    said = f"""BEGIN_SCENE
RESOLUTION {width} {height}
CAMERA ZOOM {0.5 / y} ASPECTRATIO 1.0 ANTIALIASING 0 RAYDEPTH 12
CENTER 0.0 0.0 0.0 VIEWDIR 0.0 0.0 -1.0 UPDIR 0.0 1.0 0.0 END_CAMERA
BACKGROUND 0 0 0
"""
    looks = {
        "diffuse": lambda m: ("0.0 DIFFUSE 1.0 SPECULAR 0.0", "", m["reflectance"]),
        "emissive": lambda m: ("1.0 DIFFUSE 0.0 SPECULAR 0.0", "", m["radiance"]),
        "mirror": lambda m: (f"0.0 DIFFUSE 0.0 SPECULAR {rgb(m['reflectance'])[0]}", "", 1.0),
        "phong": lambda m: (
            "0.0 DIFFUSE 1.0 SPECULAR 0.0",
            f"PHONG PLASTIC {math.pi * rgb(m['specular'])[0]} PHONG_SIZE {m['exponent']}",
            math.pi * np.array(rgb(m["diffuse"])),
        ),
    }
    for shape in scene["shapes"]:
        kind, m = look(scene, shape)
        ambient, shine, colour = words("tachyon", looks, kind)(m)
        finish = f"TEXTURE AMBIENT {ambient} OPACITY 1.0 {shine} COLOR {text(rgb(colour))} TEXFUNC 0"
        if shape["type"] == "sphere":
            said += f"SPHERE CENTER {text(shape['center'])} RAD {shape['radius']} {finish}\n"
            continue
        for a, b, c, d in quads(shape):
            for corners in ((a, b, c), (a, c, d)):
                names = zip(("V0", "V1", "V2"), corners, strict=True)
                said += f"TRI {' '.join(f'{v} {text(at)}' for v, at in names)} {finish}\n"
    fade = "ATTENUATION CONSTANT 0.0 LINEAR 0.0 QUADRATIC 1.0 COLOR"
    lamps = {
        "point": lambda l: (
            f"LIGHT CENTER {text(l['position'])} RAD 0.0001 {fade} {text(rgb(l['intensity']))}\n"
        ),
        "directional": lambda l: (
            f"DIRECTIONAL_LIGHT DIRECTION {text(l['direction'])} COLOR {text(rgb(l['irradiance']))}\n"
        ),
    }
    said += "".join(words("tachyon", lamps, kind)(light) for kind, light in lights(scene))
    (folder / "s.dat").write_text(f"{said}END_SCENE\n", encoding="utf-8")
    run("tachyon", "s.dat", "-shade_phong", "-format", "PPM48", "-o", "s.ppm", folder=folder)
    yield ppm16(folder / "s.ppm", width, height)


def povray(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    width, height, x, y = size(scene)
    said = f"""#version 3.7;
global_settings {{ assumed_gamma 1 max_trace_level 60 adc_bailout 0 }}
camera {{ perspective location 0 direction -z right x*{2 * x} up y*{2 * y} }}
"""
    none = "finish { ambient 0 diffuse 0"
    looks = {
        "diffuse": lambda m: f"pigment {{ rgb {commas(rgb(m['reflectance']))} }} "
        "finish { ambient 0 diffuse 1 }",
        "emissive": lambda m: f"pigment {{ rgb {commas(rgb(m['radiance']))} }} {none} emission 1 }}",
        "mirror": lambda m: f"pigment {{ rgb 0 }} {none} reflection "
        f"{{ {commas(rgb(m['reflectance']))} }} }}",
        "dielectric": lambda m: f"pigment {{ rgbt 1 }} {none} reflection {{ 0, 1 fresnel }} "
        f"conserve_energy }} interior {{ ior {m['interior_ior']} }}",
        "phong": lambda m: f"pigment {{ rgb {commas(math.pi * np.array(rgb(m['diffuse'])))} }} "
        f"finish {{ ambient 0 diffuse 1 phong {math.pi * rgb(m['specular'])[0]} "
        f"phong_size {m['exponent']} }}",
    }
    for shape in scene["shapes"]:
        kind, m = look(scene, shape)
        finish = words("POV-Ray", looks, kind)(m)
        if shape["type"] == "sphere":
            said += f"sphere {{ {commas(shape['center'])}, {shape['radius']} {finish} }}\n"
        elif shape["type"] == "box":
            matrix = commas(placed(shape)[:3].T)
            said += f"box {{ -1, 1 {finish} matrix {matrix} }}\n"
        else:
            for corners in quads(shape):
                at = ", ".join(commas(c) for c in (*corners, corners[0]))
                said += f"polygon {{ 5, {at} {finish} }}\n"
    fade = f"fade_distance {NEAR} fade_power 2"
    lamps = {
        "point": lambda l: f"light_source {{ {commas(l['position'])} rgb "
        f"{commas(np.array(rgb(l['intensity'])) / (2.0 * NEAR**2))} {fade} }}\n",
        "directional": lambda l: f"light_source {{ {commas(-100.0 * np.array(l['direction']))} rgb "
        f"{commas(rgb(l['irradiance']))} parallel point_at 0 }}\n",
        "constant": lambda l: f"background {{ rgb {commas(rgb(l['radiance']))} }}\n",
    }
    said += "".join(words("POV-Ray", lamps, kind)(light) for kind, light in lights(scene))
    if any(look(scene, shape)[0] in ("diffuse", "phong") for shape in scene["shapes"]):
        for shape in scene["shapes"]:
            kind, m = look(scene, shape)
            said += _povray_area(shape, m, fade) if kind == "emissive" else ""
    (folder / "s.pov").write_text(said, encoding="utf-8")
    dims = (f"+W{width}", f"+H{height}", "+FP16", "-D", "-A", "File_Gamma=1", "+WT1")
    run("povray", "+Is.pov", "+Os.ppm", *dims, folder=folder)
    yield ppm16(folder / "s.ppm", width, height)


POINTS = 16
"""Along a side of POV-Ray's area lamps."""


def _povray_area(shape: Words, material: Words, fade: str) -> str:
    """A square lamp as POV-Ray has it: a grid of lights, whose strength for its first kernel of a
    cosine, a spotlight of tightness 1 all around, is the lamp's intensity along its normal."""
    a, b, _, d = quads(shape)[0]
    area = float(np.linalg.norm(np.cross(b - a, d - a)))
    normal, middle = np.cross(b - a, d - a) / area, (b + d) / 2.0
    strength = commas(area * np.array(rgb(material["radiance"])) / (2.0 * NEAR**2) / math.pi)
    sides = (1.0 - 1.0 / POINTS) * (b - a), (1.0 - 1.0 / POINTS) * (d - a)
    grid = f"area_light {commas(sides[0])}, {commas(sides[1])}, {POINTS}, {POINTS}"
    lobe = f"spotlight point_at {commas(middle + normal)} radius 89.99 falloff 90 tightness 1"
    return f"light_source {{ {commas(middle)} rgb {strength} {fade} {lobe} {grid} area_illumination }}\n"


def radiance(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    import pyradiance  # type: ignore[import-not-found]

    programs = Path(pyradiance.__file__).parent / "bin"
    width, height, x, y = size(scene)
    looks = {
        "diffuse": lambda m: f"plastic {{}} 0 0 5 {text(rgb(m['reflectance']))} 0 0",
        "emissive": lambda m: f"light {{}} 0 0 3 {text(rgb(m['radiance']))}",
        "mirror": lambda m: f"metal {{}} 0 0 5 {text(rgb(m['reflectance']))} 1 0",
        "dielectric": lambda m: f"dielectric {{}} 0 0 5 1 1 1 {m['interior_ior']} 0",
        "phong": lambda m: f"plasfunc {{}} 2 phong phong.cal 0 5 "
        f"{text(math.pi * np.array(rgb(m['diffuse'])) / (1.0 - rgb(m['specular'])[0]))} "
        f"{rgb(m['specular'])[0]} {m['exponent']}",
    }
    # The function is multiplied by its share, which diffuse light lacks, and the cosine over π.
    (folder / "phong.cal").write_text(
        "phong(x,y,z) = if(N(x,y,z), 3.14159265358979*max(R(x,y,z), 0)^A5/N(x,y,z), 0);\n"
        "N(x,y,z) = x*Nx + y*Ny + z*Nz;\n"
        "R(x,y,z) = 2*N(x,y,z)*(-(Dx*Nx + Dy*Ny + Dz*Nz)) + x*Dx + y*Dy + z*Dz;\n"
        "max(a,b) = if(a-b, a, b);\n",
        encoding="utf-8",
    )
    said = ""
    for k, shape in enumerate(scene["shapes"]):
        kind, m = look(scene, shape)
        said += f"void {words('Radiance', looks, kind)(m).format(f'm{k}')}\n"
        if shape["type"] == "sphere":
            said += f"m{k} sphere s{k} 0 0 4 {text(shape['center'])} {shape['radius']}\n"
            continue
        for j, corners in enumerate(quads(shape)):
            said += f"m{k} polygon s{k}_{j} 0 0 12 {text(corners)}\n"
    disc = math.pi * math.sin(math.radians(SUN / 2.0)) ** 2
    lamps = {
        "point": lambda l: f"void light l 0 0 3 {text(np.array(rgb(l['intensity'])) / math.pi / SMALL**2)}\n"
        f"l sphere p 0 0 4 {text(l['position'])} {SMALL}\n",
        "directional": lambda l: f"void light l 0 0 3 {text(np.array(rgb(l['irradiance'])) / disc)}\n"
        f"l source p 0 0 4 {text(-np.array(l['direction']))} {SUN}\n",
        "constant": lambda l: f"void glow k 0 0 4 {text(rgb(l['radiance']))} 0\nk source d 0 0 4 0 0 1 360\n",
    }
    said += "".join(words("Radiance", lamps, kind)(light) for kind, light in lights(scene))
    (folder / "s.rad").write_text(said, encoding="utf-8")
    angles = [2.0 * math.degrees(math.atan(half)) for half in (x, y)]
    view = f"-vtv -vp 0 0 0 -vd 0 0 -1 -vu 0 1 0 -vh {angles[0]} -vv {angles[1]}"
    rays = f"{programs}/vwrays -ff -pa 0 -pj 0 {view} -x {width} -y {height}"
    exact = "-dj 0 -ds 0.02 -dt 0 -ab 0 -lr 100 -lw 1e-9"
    steps = f"{programs}/oconv s.rad > s.oct; {rays} | {programs}/rtrace -fff -h {exact} s.oct > s.raw"
    run("sh", "-c", steps, folder=folder)
    yield np.fromfile(folder / "s.raw", np.float32).reshape(height, width, 3).astype(float)


def luxcore(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    import pyluxcore  # type: ignore[import-not-found]

    os.chdir(folder)
    pyluxcore.Init(lambda line: None)
    width, height, _, _ = size(scene)
    said = f"""scene.camera.lookat.orig = 0 0 0
scene.camera.lookat.target = 0 0 -1
scene.camera.up = 0 1 0
scene.camera.fieldofview = {longer(scene)}
scene.camera.cliphither = 0.001
"""
    looks = {
        "diffuse": lambda m: ("type = matte", f"kd = {text(rgb(m['reflectance']))}"),
        "emissive": lambda m: (
            "type = matte",
            "kd = 0 0 0",
            f"emission = {text(rgb(m['radiance']))}",
        ),
        "mirror": lambda m: ("type = mirror", f"kr = {text(rgb(m['reflectance']))}"),
        "dielectric": lambda m: (
            *("type = glass", "kr = 1 1 1", "kt = 1 1 1", f"interiorior = {m['interior_ior']}"),
            *(("volume.interior = v",) if inside(scene) else ()),
        ),
        "rough_conductor": lambda m: (
            *("type = metal2", f"n = {text(rgb(m['eta']))}", f"k = {text(rgb(m['k']))}"),
            *(f"uroughness = {m['alpha']}", f"vroughness = {m['alpha']}"),
        ),
    }
    for k, shape in enumerate(scene["shapes"]):
        kind, m = look(scene, shape)
        corners, faces, normals = mesh(shape)
        fields = ["type = inlinedmesh", f"vertices = {text(corners)}"]
        fields.append(f"faces = {' '.join(map(str, faces.ravel().tolist()))}")
        fields += [f"normals = {text(normals)}"] if normals is not None else []
        said += "".join(f"scene.shapes.s{k}.{line}\n" for line in fields)
        said += f"scene.objects.s{k}.shape = s{k}\nscene.objects.s{k}.material = m{k}\n"
        said += "".join(f"scene.materials.m{k}.{line}\n" for line in words("LuxCore", looks, kind)(m))
        if kind == "dielectric" and inside(scene):
            said += f"scene.volumes.v.type = clear\nscene.volumes.v.ior = {m['interior_ior']}\n"
            said += "scene.camera.volume = v\n"
    lamps = {
        "point": lambda l: (
            "type = point",
            f"position = {text(l['position'])}",
            f"gain = {text(rgb(l['intensity']))}",
        ),
        "spot": lambda l: (
            *("type = spot", f"position = {text(l['origin'])}", f"target = {text(l['target'])}"),
            *("coneangle = 30", "conedeltaangle = 5", f"gain = {text(rgb(l['intensity']))}"),
        ),
        "directional": lambda l: (
            "type = sharpdistant",
            f"direction = {text(l['direction'])}",
            f"gain = {text(rgb(l['irradiance']))}",
        ),
        "constant": lambda l: ("type = constantinfinite", f"gain = {text(rgb(l['radiance']))}"),
    }
    for k, (kind, light) in enumerate(lights(scene)):
        lines = words("LuxCore", lamps, kind)(light)
        said += "".join(f"scene.lights.l{k}.{line}\n" for line in lines)
    depths = "".join(f"path.pathdepth.{k} = 30\n" for k in ("total", "diffuse", "specular", "glossy"))
    for seed in seeds:
        described, given, config = (
            pyluxcore.Scene(),
            pyluxcore.Properties(),
            pyluxcore.Properties(),
        )
        given.SetFromString(said)
        described.Parse(given)
        config.SetFromString(
            f"renderengine.type = PATHCPU\nsampler.type = SOBOL\nrenderengine.seed = {seed}\n"
            f"film.width = {width}\nfilm.height = {height}\nfilm.filter.type = NONE\n"
            f"path.russianroulette.depth = 1000\nbatch.haltspp = {spp}\npath.clamping.variance.maxvalue = 0\n"
            f"film.outputs.1.type = RGB\nfilm.outputs.1.filename = s.exr\n{depths}"
        )
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config, described))
        session.Start()
        while not session.HasDone():
            time.sleep(0.05)
            session.UpdateStats()
        session.Stop()
        values = np.zeros(width * height * 3, np.float32)
        session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, values, 0)
        # In memory the bottom row is first, in files the top row.
        yield values.reshape(height, width, 3)[::-1].astype(float)


def cycles(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    import bpy  # type: ignore[import-not-found]

    width, height, _, _ = size(scene)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    made = bpy.context.scene
    made.render.engine = "CYCLES"
    made.cycles.samples, made.cycles.use_adaptive_sampling = spp, False
    made.cycles.pixel_filter_type, made.cycles.use_denoising = "BOX", False
    made.cycles.sample_clamp_indirect = 0.0
    for kind in ("max", "diffuse", "glossy", "transmission"):
        setattr(made.cycles, f"{kind}_bounces", 100)
    made.render.resolution_x, made.render.resolution_y = width, height
    made.render.image_settings.file_format = "OPEN_EXR"
    made.render.image_settings.color_depth = "32"
    made.render.filepath = str(folder / "s.exr")
    made.view_settings.view_transform = "Raw"
    camera = bpy.data.cameras.new("c")
    camera.angle, camera.clip_start = math.radians(longer(scene)), 1e-3
    made.camera = bpy.data.objects.new("c", camera)
    bpy.context.collection.objects.link(made.camera)
    made.world = bpy.data.worlds.new("w")
    made.world.use_nodes = True
    tree = made.world.node_tree
    sky = tree.nodes.get("Background") or tree.nodes.new("ShaderNodeBackground")
    sky.inputs[0].default_value = (0, 0, 0, 1)
    looks = {
        "diffuse": lambda m: ("ShaderNodeBsdfDiffuse", {"Color": m["reflectance"]}),
        "emissive": lambda m: ("ShaderNodeEmission", {"Color": m["radiance"], "Strength": 1.0}),
        "mirror": lambda m: (
            "ShaderNodeBsdfAnisotropic",
            {"Color": m["reflectance"], "Roughness": 0.0},
        ),
        "dielectric": lambda m: (
            "ShaderNodeBsdfGlass",
            {"IOR": m["interior_ior"], "Roughness": 0.0, "Color": 1.0},
        ),
        "rough_conductor": lambda m: (
            "ShaderNodeBsdfAnisotropic",
            {"Color": 1.0, "Roughness": math.sqrt(m["alpha"])},
        ),
    }
    for shape in scene["shapes"]:
        kind, m = look(scene, shape)
        name, values = words("Cycles", looks, kind)(m)
        material = bpy.data.materials.new("m")
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        node, out = tree.nodes.new(name), tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(node.outputs[0], out.inputs[0])
        if name == "ShaderNodeBsdfAnisotropic":
            node.distribution = "GGX"
        for key, value in values.items():
            node.inputs[key].default_value = (*rgb(value), 1.0) if key == "Color" else value
        corners, faces, normals = mesh(shape)
        shown = bpy.data.meshes.new("s")
        shown.from_pydata(corners.tolist(), [], faces.tolist())
        shown.polygons.foreach_set("use_smooth", [normals is not None] * len(faces))
        shown.materials.append(material)
        bpy.context.collection.objects.link(bpy.data.objects.new("s", shown))
    types = {"point": "POINT", "spot": "SPOT", "directional": "SUN", "constant": ""}
    for kind, light in lights(scene):
        type_ = words("Cycles", types, kind)
        if not type_:
            sky.inputs[0].default_value = (*rgb(light["radiance"]), 1.0)
            continue
        lamp = bpy.data.lights.new("l", type_)
        lamp.color = rgb(light["irradiance" if type_ == "SUN" else "intensity"])
        lamp.energy = 1.0
        setattr(lamp, "angle" if type_ == "SUN" else "shadow_soft_size", 0.0)
        holder = bpy.data.objects.new("l", lamp)
        holder.location = light.get("position", light.get("origin", (0.0, 0.0, 0.0)))
        if type_ == "SUN":
            from mathutils import Vector  # type: ignore[import-not-found]

            holder.rotation_mode = "QUATERNION"
            holder.rotation_quaternion = Vector(light["direction"]).to_track_quat("-Z", "Y")
        bpy.context.collection.objects.link(holder)
    for seed in seeds:
        made.cycles.seed = seed
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(folder / "s.exr"))
        image.colorspace_settings.name = "Non-Color"
        # In memory the bottom row is first, in files the top row.
        values = np.array(image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]
        bpy.data.images.remove(image)
        yield np.asarray(values, float)


def raysect(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    """It is spectral: a picture for each channel."""
    from raysect.core import AffineMatrix3D, Point3D, Vector3D, rotate_basis, translate
    from raysect.core.math.random import seed as set_seed
    from raysect.core.workflow import SerialEngine
    from raysect.optical import ConstantSF, World
    from raysect.optical.material import (
        AbsorbingSurface,
        Conductor,
        Dielectric,
        Lambert,
        RoughConductor,
        Sellmeier,
        UniformSurfaceEmitter,
    )
    from raysect.optical.observer import PinholeCamera, PowerPipeline2D
    from raysect.primitive import Box, Mesh, Sphere

    width, height, _, _ = size(scene)

    def emitter(value: float) -> Any:
        found = UniformSurfaceEmitter(ConstantSF(value), 1.0)
        found.importance = 1.0
        return found

    def glass(m: Words) -> Any:
        return Dielectric(Sellmeier(m["interior_ior"] ** 2 - 1.0, 0, 0, 0, 0, 0), ConstantSF(1.0))

    def matte(value: float) -> Any:
        return Lambert(ConstantSF(value)) if value else AbsorbingSurface()

    looks: dict[str, Callable[[Words, int], Any]] = {
        "diffuse": lambda m, c: matte(rgb(m["reflectance"])[c]),
        "emissive": lambda m, c: emitter(rgb(m["radiance"])[c]),
        "dielectric": lambda m, c: glass(m),
        "mirror": lambda m, c: Conductor(ConstantSF(SMALL**3), ConstantSF(1.0)),
        "rough_conductor": lambda m, c: RoughConductor(
            ConstantSF(m["eta"]), ConstantSF(m["k"]), m["alpha"]
        ),
    }
    far = 1e3
    disc = math.sin(math.radians(SUN / 2.0))

    def shown(channel: int) -> Array:
        world, kept = World(), []
        for shape in scene["shapes"]:
            kind, m = look(scene, shape)
            material = words("raysect", looks, kind)(m, channel)
            if shape["type"] == "sphere":
                kept.append(
                    Sphere(shape["radius"], world, translate(*shape["center"]), material)
                )
            elif shape["type"] == "box":
                place = AffineMatrix3D(placed(shape).tolist())
                one = Point3D(-1, -1, -1), Point3D(1, 1, 1)
                kept.append(Box(*one, world, place, material))
            else:
                corners, faces, _ = mesh(shape)
                kept.append(
                    Mesh(corners, faces, smoothing=False, closed=False, parent=world, material=material)
                )
        lamps: dict[str, Callable[[Words], Any]] = {
            "point": lambda l: Sphere(
                SMALL,
                world,
                translate(*l["position"]),
                emitter(rgb(l["intensity"])[channel] / math.pi / SMALL**2),
            ),
            "directional": lambda l: Sphere(
                far * disc,
                world,
                translate(*(-far * np.array(l["direction"])).tolist()),
                emitter(rgb(l["irradiance"])[channel] / math.pi / disc**2),
            ),
            "constant": lambda l: Sphere(
                far, world, material=emitter(rgb(l["radiance"])[channel])
            ),
        }
        kept += [words("raysect", lamps, kind)(light) for kind, light in lights(scene)]
        pipeline = PowerPipeline2D(display_progress=False, accumulate=False)
        turned = rotate_basis(Vector3D(0, 0, -1), Vector3D(0, 1, 0))
        camera = PinholeCamera(
            (width, height),
            fov=longer(scene),
            pipelines=[pipeline],
            parent=world,
            transform=turned,
        )
        camera.pixel_samples, camera.spectral_bins, camera.quiet = spp, 1, True
        camera.min_wavelength, camera.max_wavelength = 500, 501
        camera.ray_max_depth, camera.ray_extinction_min_depth = 100, 50
        camera.render_engine = SerialEngine()
        camera.observe()
        return np.array(pipeline.frame.mean).T  # by column and row

    for seed in seeds:
        set_seed(seed)
        yield np.stack([shown(channel) for channel in range(3)], axis=-1)


def mitsuba(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    width, height, _, _ = size(scene)
    map_ = mi.ScalarTransform4f

    def even(value: Any) -> Words:
        return {"type": "rgb", "value": list(rgb(value))}

    looks = {
        "diffuse": lambda m: {"type": "diffuse", "reflectance": even(m["reflectance"])},
        "mirror": lambda m: {
            "type": "conductor",
            "material": "none",
            "specular_reflectance": even(m["reflectance"]),
        },
        "dielectric": lambda m: {"type": "dielectric", "int_ior": m["interior_ior"], "ext_ior": 1.0},
        "rough_conductor": lambda m: {
            "type": "roughconductor",
            "distribution": "ggx",
            "alpha": m["alpha"],
            "eta": m["eta"],
            "k": m["k"],
        },
    }
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}}
    sensor: Words = {"type": "perspective", "fov": scene["camera"]["fov"], "film": film}
    sensor["to_world"] = map_().look_at([0, 0, 0], [0, 0, -1], [0, 1, 0])
    sensor["sampler"] = {"type": "multijitter", "sample_count": spp}
    parts: Words = {"sensor": sensor}
    for k, shape in enumerate(scene["shapes"]):
        kind, m = look(scene, shape)
        types = {"sphere": "sphere", "rectangle": "rectangle", "box": "cube"}
        parts[f"s{k}"] = one = {"type": types[shape["type"]]}
        if shape["type"] == "sphere":
            one |= {"center": list(shape["center"]), "radius": shape["radius"]}
        else:
            one["to_world"] = map_(placed(shape).tolist())
        if kind == "emissive":
            one["emitter"] = {"type": "area", "radiance": even(m["radiance"])}
            one["bsdf"] = {"type": "diffuse", "reflectance": even(0.0)}
        else:
            one["bsdf"] = words("Mitsuba", looks, kind)(m)
    lamps = {
        "point": lambda l: {"position": l["position"], "intensity": even(l["intensity"])},
        "spot": lambda l: {
            "to_world": map_().look_at(l["origin"], l["target"], [0, 1, 0]),
            "intensity": even(l["intensity"]),
        },
        "directional": lambda l: {"direction": l["direction"], "irradiance": even(l["irradiance"])},
        "constant": lambda l: {"radiance": even(l["radiance"])},
    }
    for k, (kind, light) in enumerate(lights(scene)):
        parts[f"l{k}"] = {"type": kind, **words("Mitsuba", lamps, kind)(light)}
    path = {"type": "path", "max_depth": 64, "rr_depth": 64}
    loaded = mi.load_dict({"type": "scene", "integrator": path, **parts})
    for seed in seeds:
        yield np.array(mi.render(loaded, seed=seed)).astype(float)


def three(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    from drive_browsers import drawn

    yield drawn("three", scene, folder)


def babylon(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    from drive_browsers import drawn

    yield drawn("babylon", scene, folder)


Driver = Callable[[Words, Path, Sequence[int], int], Iterator[Array]]
BY_CENTRES: dict[str, Driver] = {
    one.__name__: one for one in (babylon, povray, radiance, tachyon, three)
}
"""One sample of each pixel, no random numbers."""
BY_CHANCE: dict[str, Driver] = {one.__name__: one for one in (cycles, luxcore, mitsuba, raysect)}
DRIVERS = {**BY_CENTRES, **BY_CHANCE}


def drawn_by(name: str, scene: Words, seeds: Sequence[int] = (1,), spp: int = 64) -> Array:
    """(seeds, height, width, 3), of one picture where there are no random numbers."""
    with tempfile.TemporaryDirectory() as folder:
        return np.stack(list(DRIVERS[name](scene, Path(folder), seeds, spp)))


if __name__ == "__main__":
    name, scene_file, out, seeds, spp = sys.argv[1:]
    out = os.path.abspath(out)
    described = json.loads(Path(scene_file).read_text(encoding="utf-8"))
    try:
        np.save(out, drawn_by(name, described, [int(k) for k in seeds.split(",")], int(spp)))
        code = 0
    except HasNoneError as error:
        print(error, flush=True)
        code = 3
    os._exit(code)  # pyluxcore and bpy need not be taken down
