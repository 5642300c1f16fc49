"""Path tracers."""

import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from words import (
    SMALL,
    SUN,
    Array,
    Words,
    inside,
    lights,
    longer,
    look,
    mesh,
    placed,
    rgb,
    size,
    text,
    words,
)


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
        said += "".join(
            f"scene.materials.m{k}.{line}\n" for line in words("LuxCore", looks, kind)(m)
        )
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
    depths = "".join(
        f"path.pathdepth.{k} = 30\n" for k in ("total", "diffuse", "specular", "glossy")
    )
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
            f"path.russianroulette.depth = 1000\nbatch.haltspp = {spp}\n"
            f"path.clamping.variance.maxvalue = 0\n"
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
    far = 1e5
    disc = math.sin(math.radians(SUN / 2.0))

    def shown(channel: int) -> Array:
        world, kept = World(), []
        for shape in scene["shapes"]:
            kind, m = look(scene, shape)
            material = words("raysect", looks, kind)(m, channel)
            if shape["type"] == "sphere":
                kept.append(Sphere(shape["radius"], world, translate(*shape["center"]), material))
            elif shape["type"] == "box":
                place = AffineMatrix3D(placed(shape).tolist())
                one = Point3D(-1, -1, -1), Point3D(1, 1, 1)
                kept.append(Box(*one, world, place, material))
            elif kind == "emissive":
                corners, faces, _ = mesh(shape)
                flat = {"smoothing": False, "closed": False, "parent": world}
                kept.append(Mesh(corners, faces, material=material, **flat))
            else:  # a box, since what meshes of float32 scatter meets them again
                # Its maps have to keep lengths: cosines are those of directions that they change.
                matrix = placed(shape)
                x, y, z = np.linalg.norm(matrix[:3, :3], axis=0)
                place = AffineMatrix3D((matrix / [x, y, z, 1.0]).tolist())
                kept.append(Box(Point3D(-x, -y, -0.1), Point3D(x, y, 0), world, place, material))
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
            "constant": lambda l: Sphere(far, world, material=emitter(rgb(l["radiance"])[channel])),
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
        camera.ray_important_path_weight = 0.9
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
        "dielectric": lambda m: {
            "type": "dielectric",
            "int_ior": m["interior_ior"],
            "ext_ior": 1.0,
        },
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
