"""Measures a renderer's conventions: `python docs/measure_conventions.py NAME` prints them as JSON.

It needs the renderer and NumPy alone: tachyon and POV-Ray by apt, the others by pip (raysect,
mitsuba, pyluxcore, pyradiance, bpy) in the environment that runs it, since some exclude others.

Three pictures of 64 x 64 pixels, 40 degrees wide, from the origin along -z, y up:
- a shining ball, off the middle: the turn and the shift with which its formula fits best;
- an even sky of radiance 1 seen from inside glass of index 1.5: 2.25 where radiance is divided by
  the square of the index, else 1;
- a matte wall of albedo 0.5, 3 from each lamp whose number is 1: its light, as a multiple of that
  of 1 W/sr (point, spot) or 1 W/m2 (directional).
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

N, FOV = 64, 40.0
HALF = math.tan(math.radians(FOV / 2.0))
CENTRE, RADIUS = (0.35, 0.6, -4.0), 0.7
INDEX, ALBEDO, DISTANCE = 1.5, 0.5, 3.0


def seen(right: float, down: float, samples: int, cosine: bool = False) -> Array:
    """The formula's picture of the ball, moved, with so many samples along a pixel's side."""
    at = (np.arange(N * samples) + 0.5) / samples
    x, y = HALF * ((at - right) / N * 2.0 - 1.0), HALF * (1.0 - (at - down) / N * 2.0)
    d = np.stack([*np.meshgrid(x, y), -np.ones((at.size, at.size))], axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    along = d @ np.array(CENTRE)
    hit = (along**2 > np.dot(CENTRE, CENTRE) - RADIUS**2) & (along > 0.0)
    values = hit * (-d[..., 2] if cosine else 1.0)
    return np.asarray(values.reshape(N, samples, N, samples).mean(axis=(1, 3)))


def placed(picture: Array, samples: int) -> dict[str, Any]:
    """The turn and the shift, in eighths of a pixel, with the least squared difference."""
    shown = picture / picture.max()
    found = []
    for mirrored in (False, True):
        for upside_down in (False, True):
            turned = shown[:: -1 if upside_down else 1, :: -1 if mirrored else 1]
            for cosine in (False, True):
                step, at = 0.5, (0.0, 0.0)
                for step, reach in ((0.5, 3), (0.125, 4)):
                    fits = [
                        (float(((seen(x, y, samples, cosine) - turned) ** 2).sum()), x, y)
                        for x in at[0] + step * np.arange(-reach, reach + 1)
                        for y in at[1] + step * np.arange(-reach, reach + 1)
                    ]
                    least, *best = min(fits)
                    at = (best[0], best[1])
                found.append((least, mirrored, upside_down, cosine, *at))
    _, mirrored, upside_down, cosine, right, down = min(found, key=lambda one: one[0])
    names = {"mirrored": mirrored, "upside_down": upside_down, "cosine": cosine}
    return {**names, "right": float(right), "down": float(down)}


def ball_mesh(centre: tuple[float, ...], radius: float, n: int = 96) -> tuple[Array, Array]:
    """Corners and triangles of a ball, for renderers that have meshes alone."""
    theta, phi = np.linspace(0.0, math.pi, n + 1), np.arange(2 * n) * math.pi / n
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1)
    i, j = np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij")
    a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
    upper, lower = np.stack([a, b, a + 2 * n], -1)[1:], np.stack([b, b + 2 * n, a + 2 * n], -1)[:-1]
    return unit.reshape(-1, 3) * radius + centre, np.concatenate(
        [upper.reshape(-1, 3), lower.reshape(-1, 3)]
    )


WALL = ((-20.0, -20.0, -4.0), (20.0, -20.0, -4.0), (20.0, 20.0, -4.0), (-20.0, 20.0, -4.0))


def middle(picture: Array) -> float:
    """Of the four pixels in the middle."""
    return float(picture[N // 2 - 1 : N // 2 + 1, N // 2 - 1 : N // 2 + 1].mean())


def run(*command: str, folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{command[0]}: {(done.stdout + done.stderr)[-800:]}")
    return done.stdout


def samples16(data: bytes) -> Array:
    """The last picture of 16 bits of a PPM file, its mean over channels, (N, N)."""
    return np.frombuffer(data[-6 * N * N :], ">u2").reshape(N, N, 3).mean(axis=-1) / 65535.0


def tachyon(folder: Path) -> dict[str, Any]:
    head = f"""BEGIN_SCENE
RESOLUTION {N} {N}
CAMERA ZOOM {0.5 / HALF} ASPECTRATIO 1.0 ANTIALIASING 0 RAYDEPTH 3
CENTER 0.0 0.0 0.0 VIEWDIR 0.0 0.0 -1.0 UPDIR 0.0 1.0 0.0 END_CAMERA
BACKGROUND 0 0 0
"""

    def picture(text: str) -> Array:
        (folder / "s.dat").write_text(f"{head}{text}END_SCENE\n", encoding="utf-8")
        run("tachyon", "s.dat", "-format", "PPM48", "-o", "s.ppm", folder=folder)
        return samples16((folder / "s.ppm").read_bytes())

    finish = "SPECULAR 0.0 OPACITY 1.0 COLOR"
    shining = f"TEXTURE AMBIENT 1.0 DIFFUSE 0.0 {finish} 0.5 0.5 0.5 TEXFUNC 0\n"
    matte = f"TEXTURE AMBIENT 0.0 DIFFUSE 1.0 {finish} 0.5 0.5 0.5 TEXFUNC 0\n"
    wall = f"PLANE CENTER 0 0 -4 NORMAL 0 0 1 {matte}"
    fade = "ATTENUATION CONSTANT 0.0 LINEAR 0.0 QUADRATIC 1.0"
    lamps = {
        "point": f"LIGHT CENTER 0.0 0.001 -1 RAD 0.0001 {fade} COLOR 1 1 1\n",
        "directional": "DIRECTIONAL_LIGHT DIRECTION 0 0 -1 COLOR 1 1 1\n",
    }
    ball = f"SPHERE CENTER {CENTRE[0]} {CENTRE[1]} {CENTRE[2]} RAD {RADIUS} {shining}"
    return {
        "placed": placed(picture(ball), 1),
        "glass": None,
        "lamps": {
            kind: float(np.median(picture(text + wall)[28:36, 28:36]))
            for kind, text in lamps.items()
        },
    }


def povray(folder: Path) -> dict[str, Any]:
    head = f"""#version 3.7;
global_settings {{ assumed_gamma 1 max_trace_level 60 }}
camera {{ perspective location 0 direction -z right -x*{2 * HALF} up y*{2 * HALF} }}
"""

    def picture(text: str) -> Array:
        (folder / "s.pov").write_text(head + text, encoding="utf-8")
        size = (f"+W{N}", f"+H{N}", "+FP16", "-D", "-A", "File_Gamma=1")
        run("povray", "+Is.pov", "+Os.ppm", *size, folder=folder)
        return samples16((folder / "s.ppm").read_bytes())

    none = "finish { ambient 0 diffuse 0"
    # The camera's `right` is negative: its space, and the ball, are the mirror image of ours.
    ball = f"sphere {{ <-0.35, 0.6, -4>, 0.7 pigment {{ rgb 0.5 }} {none} emission 1 }} }}"
    clear = f"pigment {{ rgbt 1 }} {none} reflection {{ 0, 1 fresnel }} conserve_energy }}"
    glass = f"sphere {{ 0, 2 {clear} interior {{ ior {INDEX} }} }} background {{ rgb 0.4 }}"
    wall = f"plane {{ z, -4 pigment {{ rgb {ALBEDO} }} finish {{ ambient 0 diffuse 1 }} }}"
    lamps = {
        "point": "light_source { <0, 0, -1> rgb 1 fade_distance 0.1 fade_power 2 }",
        "directional": "light_source { <0, 0, 10> rgb 1 parallel point_at 0 }",
    }
    return {
        "placed": placed(picture(ball), 1),
        "glass": middle(picture(glass)) / 0.4,
        "lamps": {kind: middle(picture(text + wall)) for kind, text in lamps.items()},
    }


def luxcore(folder: Path) -> dict[str, Any]:
    import time

    import pyluxcore  # type: ignore[import-not-found]

    os.chdir(folder)
    pyluxcore.Init(lambda line: None)
    head = f"""scene.camera.lookat.orig = 0 0 0
scene.camera.lookat.target = 0 0 -1
scene.camera.up = 0 1 0
scene.camera.fieldofview = {FOV}
"""

    def shape(corners: Any, faces: Any, material: str) -> str:
        points = " ".join(f"{v:.9g}" for v in np.ravel(corners))
        indices = " ".join(str(k) for k in np.ravel(faces))
        fields = ("type = inlinedmesh", f"vertices = {points}", f"faces = {indices}")
        said = "".join(f"scene.shapes.s.{line}\n" for line in fields)
        return f"{said}scene.objects.s.shape = s\nscene.objects.s.material = m\n{material}"

    def picture(text: str, spp: int = 64) -> Array:
        scene, given, config = pyluxcore.Scene(), pyluxcore.Properties(), pyluxcore.Properties()
        given.SetFromString(head + text)
        scene.Parse(given)
        depths = "".join(f"path.pathdepth.{k} = 60\n" for k in ("total", "specular", "glossy"))
        config.SetFromString(
            f"renderengine.type = PATHCPU\nsampler.type = SOBOL\n"
            f"film.width = {N}\nfilm.height = {N}\n"
            f"film.filter.type = NONE\npath.russianroulette.depth = 1000\nbatch.haltspp = {spp}\n"
            f"film.outputs.1.type = RGB\nfilm.outputs.1.filename = s.exr\n{depths}"
        )
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config, scene))
        session.Start()
        while not session.HasDone():
            time.sleep(0.05)
            session.UpdateStats()
        session.Stop()
        values = np.zeros(N * N * 3, np.float32)
        session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, values, 0)
        return values.reshape(N, N, 3)[::-1].mean(axis=-1).astype(float)  # the bottom row first

    def material(*lines: str) -> str:
        return "".join(f"scene.materials.m.{line}\n" for line in lines)

    glass = material(
        "type = glass", "kr = 1 1 1", "kt = 1 1 1", f"interiorior = {INDEX}", "volume.interior = v"
    )
    glass += (
        f"scene.volumes.v.type = clear\nscene.volumes.v.ior = {INDEX}\nscene.camera.volume = v\n"
    )
    sky = "scene.lights.l.type = constantinfinite\n"
    shining = material("type = matte", "kd = 0 0 0", "emission = 1 1 1")
    wall = shape(WALL, ((0, 1, 2), (0, 2, 3)), material("type = matte", "kd = 0.5 0.5 0.5"))
    place = ("position = 0 0 -1",)
    lamps = {
        "point": ("type = point", *place),
        "spot": ("type = spot", *place, "target = 0 0 -2", "coneangle = 30", "conedeltaangle = 5"),
        "directional": ("type = sharpdistant", "direction = 0 0 -1"),
    }
    lit = {
        kind: middle(picture(wall + "".join(f"scene.lights.l.{line}\n" for line in lines)))
        for kind, lines in lamps.items()
    }
    return {
        "placed": placed(picture(shape(*ball_mesh(CENTRE, RADIUS), shining), 256), 8),
        "glass": float(picture(shape(*ball_mesh((0, 0, 0), 2.0), glass) + sky, 256).mean()),
        "lamps": lit,
    }


def radiance(folder: Path) -> dict[str, Any]:
    import pyradiance  # type: ignore[import-not-found]

    programs = Path(pyradiance.__file__).parent / "bin"

    def picture(text: str, options: str = "", n: int = N) -> Array:
        (folder / "s.rad").write_text(text, encoding="utf-8")
        view = f"-vtv -vp 0 0 0 -vd 0 0 -1 -vu 0 1 0 -vh {FOV} -vv {FOV} -x {n} -y {n}"
        steps = (
            f"{programs}/oconv s.rad > s.oct; {programs}/rpict {view} -ps 1 -pj 0 {options} s.oct"
        )
        run(
            "sh", "-c", f"{steps} > s.hdr; {programs}/pvalue -h -H -df s.hdr > s.raw", folder=folder
        )
        found = np.fromfile(folder / "s.raw", np.float32).reshape(n, n, 3).mean(axis=-1)
        return found.reshape(N, n // N, N, n // N).mean(axis=(1, 3)).astype(float)

    place = " ".join(map(str, CENTRE))
    ball = f"void light m 0 0 3 1 1 1\nm sphere s 0 0 4 {place} {RADIUS}\n"
    sky = "void glow k 0 0 4 1 1 1 0\nk source d 0 0 4 0 0 1 360\n"
    glass = f"void dielectric m 0 0 5 1 1 1 {INDEX} 0\nm sphere s 0 0 4 0 0 0 2\n{sky}"
    return {
        "placed": placed(picture(ball, n=8 * N), 8),
        "glass": float(picture(glass, "-lr 100 -lw 1e-9").mean()),
        "lamps": {},
    }


def cycles(folder: Path) -> dict[str, Any]:
    import bpy  # type: ignore[import-not-found]

    def fresh(spp: int = 64) -> Any:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = bpy.context.scene
        scene.render.engine = "CYCLES"
        scene.cycles.samples, scene.cycles.use_adaptive_sampling = spp, False
        scene.cycles.pixel_filter_type, scene.cycles.use_denoising = "BOX", False
        scene.cycles.max_bounces = scene.cycles.transmission_bounces = 100
        scene.cycles.glossy_bounces = 100
        scene.render.resolution_x = scene.render.resolution_y = N
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        scene.render.filepath = str(folder / "s.exr")
        camera = bpy.data.cameras.new("c")
        camera.angle, camera.clip_start = math.radians(FOV), 1e-3
        scene.camera = bpy.data.objects.new("c", camera)
        bpy.context.collection.objects.link(scene.camera)
        scene.world = bpy.data.worlds.new("w")
        scene.world.use_nodes = True
        tree = scene.world.node_tree
        return tree.nodes.get("Background") or tree.nodes.new("ShaderNodeBackground")

    def shape(corners: Any, faces: Any, kind: str, **values: Any) -> None:
        material = bpy.data.materials.new("m")
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        node, out = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(node.outputs[0], out.inputs[0])
        for name, value in values.items():
            node.inputs[name].default_value = value
        mesh = bpy.data.meshes.new("s")
        mesh.from_pydata(np.asarray(corners).tolist(), [], np.asarray(faces).tolist())
        mesh.materials.append(material)
        bpy.context.collection.objects.link(bpy.data.objects.new("s", mesh))

    def picture() -> Array:
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(folder / "s.exr"))
        image.colorspace_settings.name = "Non-Color"
        values = np.array(image.pixels[:]).reshape(N, N, 4)[::-1, :, :3].mean(axis=-1)
        bpy.data.images.remove(image)
        return np.asarray(values)

    fresh(256).inputs[0].default_value = (0, 0, 0, 1)
    shape(*ball_mesh(CENTRE, RADIUS), "ShaderNodeEmission", Strength=1.0)
    ball = picture()
    fresh(256).inputs[0].default_value = (1, 1, 1, 1)
    shape(*ball_mesh((0, 0, 0), 2.0), "ShaderNodeBsdfGlass", IOR=INDEX, Roughness=0.0)
    glass = float(picture().mean())
    lit = {}
    for kind, type_ in (("point", "POINT"), ("spot", "SPOT"), ("directional", "SUN")):
        fresh().inputs[0].default_value = (0, 0, 0, 1)
        shape(WALL, ((0, 1, 2, 3),), "ShaderNodeBsdfDiffuse", Color=(ALBEDO,) * 3 + (1.0,))
        lamp = bpy.data.lights.new("l", type_)
        lamp.energy = 1.0
        setattr(lamp, "angle" if type_ == "SUN" else "shadow_soft_size", 0.0)
        holder = bpy.data.objects.new("l", lamp)
        holder.location = (0.0, 0.0, -1.0)
        bpy.context.collection.objects.link(holder)
        lit[kind] = middle(picture())
    return {"placed": placed(ball, 8), "glass": glass, "lamps": lit}


def raysect(folder: Path) -> dict[str, Any]:
    from raysect.core import Vector3D, rotate_basis, translate
    from raysect.core.workflow import SerialEngine
    from raysect.optical import ConstantSF, World
    from raysect.optical.material import Dielectric, Sellmeier, UniformSurfaceEmitter
    from raysect.optical.observer import PinholeCamera, PowerPipeline2D
    from raysect.primitive import Sphere

    def picture(world: Any, spp: int) -> Array:
        pipeline = PowerPipeline2D(display_progress=False, accumulate=False)
        turned = rotate_basis(Vector3D(0, 0, -1), Vector3D(0, 1, 0))
        camera = PinholeCamera(
            (N, N), fov=FOV, pipelines=[pipeline], parent=world, transform=turned
        )
        camera.pixel_samples, camera.spectral_bins, camera.quiet = spp, 1, True
        camera.min_wavelength, camera.max_wavelength = 500, 501
        camera.ray_max_depth, camera.ray_extinction_min_depth = 100, 50
        camera.render_engine = SerialEngine()
        camera.observe()
        return np.array(pipeline.frame.mean).T

    shining = UniformSurfaceEmitter(ConstantSF(1.0), 1.0)
    world = World()
    ball = Sphere(RADIUS, world, translate(*CENTRE), shining)
    shown = picture(world, 256)
    inside = World()
    clear = Dielectric(Sellmeier(INDEX**2 - 1.0, 0, 0, 0, 0, 0), ConstantSF(1.0))
    kept = [ball, Sphere(100.0, inside, material=shining), Sphere(2.0, inside, material=clear)]
    cosine = 1.0 / math.sqrt(1.0 + 2.0 * (HALF / N) ** 2)
    found = middle(picture(inside, 64)) / cosine
    del kept
    return {"placed": placed(shown, 8), "glass": found, "lamps": {}}


def mitsuba(folder: Path) -> dict[str, Any]:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")

    def picture(spp: int, **parts: Any) -> Array:
        film = {"type": "hdrfilm", "width": N, "height": N, "rfilter": {"type": "box"}}
        sensor: dict[str, Any] = {"type": "perspective", "fov": FOV, "film": film}
        sensor["to_world"] = mi.ScalarTransform4f().look_at([0, 0, 0], [0, 0, -1], [0, 1, 0])
        sensor["sampler"] = {"type": "multijitter", "sample_count": spp}
        path = {"type": "path", "max_depth": 64, "rr_depth": 64}
        scene = mi.load_dict({"type": "scene", "integrator": path, "sensor": sensor, **parts})
        return np.array(mi.render(scene)).mean(axis=-1).astype(float)

    def even(value: float) -> dict[str, Any]:
        return {"type": "rgb", "value": value}

    shining = {"type": "area", "radiance": even(1.0)}
    ball = {"type": "sphere", "center": CENTRE, "radius": RADIUS, "emitter": shining}
    clear = {"type": "dielectric", "int_ior": INDEX, "ext_ior": 1.0}
    sphere = {"type": "sphere", "radius": 2.0, "bsdf": clear}
    far = mi.ScalarTransform4f().translate([0, 0, -4]).scale(20.0)
    matte = {"type": "diffuse", "reflectance": even(ALBEDO)}
    wall = {"type": "rectangle", "to_world": far, "bsdf": matte}
    looks = mi.ScalarTransform4f().look_at([0, 0, -1], [0, 0, -4], [0, 1, 0])
    lamps: dict[str, dict[str, Any]] = {
        "point": {"type": "point", "position": [0, 0, -1], "intensity": even(1.0)},
        "spot": {"type": "spot", "to_world": looks, "intensity": even(1.0)},
        "directional": {"type": "directional", "direction": [0, 0, -1], "irradiance": even(1.0)},
    }
    return {
        "placed": placed(picture(256, s=ball), 8),
        "glass": float(picture(64, s=sphere, sky={"type": "constant"}).mean()),
        "lamps": {kind: middle(picture(16, s=wall, l=lamp)) for kind, lamp in lamps.items()},
    }


RENDERERS: dict[str, Callable[[Path], dict[str, Any]]] = {
    one.__name__: one for one in (cycles, luxcore, mitsuba, povray, radiance, raysect, tachyon)
}


def measured(name: str) -> dict[str, Any]:
    """The conventions of a renderer."""
    with tempfile.TemporaryDirectory() as folder:
        found = RENDERERS[name](Path(folder))
    for kind, light in found["lamps"].items():
        unit = ALBEDO / math.pi / (1.0 if kind == "directional" else DISTANCE**2)
        found["lamps"][kind] = light / unit
    return found


if __name__ == "__main__":
    print(json.dumps(measured(sys.argv[1])), flush=True)
    os._exit(0)  # pyluxcore and bpy need not be taken down
