"""Renderers without random numbers: a ray through each pixel's centre."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from words import (
    NEAR,
    SMALL,
    SUN,
    Array,
    HasNoneError,
    Words,
    axis,
    commas,
    lights,
    look,
    placed,
    ppm16,
    quads,
    rgb,
    run,
    size,
    text,
    words,
)


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
        finish = (
            f"TEXTURE AMBIENT {ambient} OPACITY 1.0 {shine} COLOR {text(rgb(colour))} TEXFUNC 0"
        )
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
            f"DIRECTIONAL_LIGHT DIRECTION {text(l['direction'])} "
            f"COLOR {text(rgb(l['irradiance']))}\n"
        ),
        "spot": lambda l: (
            f"SPOTLIGHT CENTER {text(l['origin'])} RAD 0.0001 DIRECTION {text(axis(l))} "
            f"FALLOFF_START 25.0 FALLOFF_END 30.0 {fade} {text(rgb(l['intensity']))}\n"
        ),
        "constant": lambda l: "",  # the option -add_skylight
    }
    if {"emissive", "diffuse"} <= {look(scene, shape)[0] for shape in scene["shapes"]}:
        raise HasNoneError("tachyon has no lamps that are surfaces")
    said += "".join(words("tachyon", lamps, kind)(light) for kind, light in lights(scene))
    (folder / "s.dat").write_text(f"{said}END_SCENE\n", encoding="utf-8")
    options = ["-shade_phong", "-format", "PPM48", "-o", "s.ppm"]
    for kind, light in lights(scene):
        if kind == "constant":  # of one brightness for all channels
            brightness, *_ = rgb(light["radiance"])
            options += ["-add_skylight", str(brightness), "-skylight_samples", "1024"]
    run("tachyon", "s.dat", *options, folder=folder)
    yield ppm16(folder / "s.ppm", width, height)


def povray(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    width, height, x, y = size(scene)
    said = f"""#version 3.7;
global_settings {{ assumed_gamma 1 max_trace_level 60 adc_bailout 0 }}
camera {{ perspective location 0 direction -z right x*{2 * x} up y*{2 * y} }}
"""
    none = "finish { ambient 0 diffuse 0"
    looks = {
        "diffuse": lambda m: (
            f"pigment {{ rgb {commas(rgb(m['reflectance']))} }} finish {{ ambient 0 diffuse 1 }}"
        ),
        "emissive": lambda m: (
            f"pigment {{ rgb {commas(rgb(m['radiance']))} }} {none} emission 1 }}"
        ),
        "mirror": lambda m: (
            f"pigment {{ rgb 0 }} {none} reflection {{ {commas(rgb(m['reflectance']))} }} }}"
        ),
        "dielectric": lambda m: (
            f"pigment {{ rgbt 1 }} {none} reflection {{ 0, 1 fresnel }} "
            f"conserve_energy }} interior {{ ior {m['interior_ior']} }}"
        ),
        "phong": lambda m: (
            f"pigment {{ rgb {commas(math.pi * np.array(rgb(m['diffuse'])))} }} "
            f"finish {{ ambient 0 diffuse 1 phong {math.pi * rgb(m['specular'])[0]} "
            f"phong_size {m['exponent']} }}"
        ),
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
    # Without it a background is seen, and lights nothing.
    skylight = "global_settings { radiosity { count 1600 recursion_limit 1 brightness 1 } }\n"
    lamps = {
        "point": lambda l: (
            f"light_source {{ {commas(l['position'])} rgb "
            f"{commas(np.array(rgb(l['intensity'])) / (2.0 * NEAR**2))} {fade} }}\n"
        ),
        "directional": lambda l: (
            f"light_source {{ {commas(-100.0 * np.array(l['direction']))} rgb "
            f"{commas(rgb(l['irradiance']))} parallel point_at 0 }}\n"
        ),
        "spot": lambda l: (
            f"light_source {{ {commas(l['origin'])} rgb "
            f"{commas(np.array(rgb(l['intensity'])) / (2.0 * NEAR**2))} {fade} spotlight "
            f"point_at {commas(l['target'])} radius 25 falloff 30 tightness 0 }}\n"
        ),
        "constant": lambda l: f"background {{ rgb {commas(rgb(l['radiance']))} }}\n{skylight}",
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
    """A lamp as POV-Ray has it: a grid of spotlights of tightness 1, a power of the cosine, as wide
    as half of space, each at the middle of its part of the lamp."""
    a, b, _, d = quads(shape)[0]
    area = float(np.linalg.norm(np.cross(b - a, d - a)))
    normal, middle = np.cross(b - a, d - a) / area, (b + d) / 2.0
    strength = commas(area * np.array(rgb(material["radiance"])) / (2.0 * NEAR**2) / math.pi)
    sides = (1.0 - 1.0 / POINTS) * (b - a), (1.0 - 1.0 / POINTS) * (d - a)
    grid = f"area_light {commas(sides[0])}, {commas(sides[1])}, {POINTS}, {POINTS}"
    lobe = f"spotlight point_at {commas(middle + normal)} radius 89.99 falloff 90 tightness 1"
    light = f"{commas(middle)} rgb {strength} {fade} {lobe} {grid} area_illumination"
    return f"light_source {{ {light} }}\n"


def radiance(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    import pyradiance  # type: ignore[import-not-found]

    programs = Path(pyradiance.__file__).parent / "bin"
    width, height, x, y = size(scene)
    looks = {
        "diffuse": lambda m: f"plastic {{}} 0 0 5 {text(rgb(m['reflectance']))} 0 0",
        "emissive": lambda m: f"light {{}} 0 0 3 {text(rgb(m['radiance']))}",
        "mirror": lambda m: f"metal {{}} 0 0 5 {text(rgb(m['reflectance']))} 1 0",
        "dielectric": lambda m: f"dielectric {{}} 0 0 5 1 1 1 {m['interior_ior']} 0",
        "phong": lambda m: (
            f"plasfunc {{}} 2 phong phong.cal 0 5 "
            f"{text(math.pi * np.array(rgb(m['diffuse'])) / (1.0 - rgb(m['specular'])[0]))} "
            f"{rgb(m['specular'])[0]} {m['exponent']}"
        ),
    }
    # The function is multiplied by its share, which diffuse light lacks, and the cosine.
    (folder / "phong.cal").write_text(
        "phong(x,y,z) = lobe(x*Nx + y*Ny + z*Nz, x*Dx + y*Dy + z*Dz);\n"
        "lobe(c,d) = if(c, positive(d - 2*c*(Dx*Nx + Dy*Ny + Dz*Nz))^A5/c, 0);\n"
        "positive(v) = if(v, v, 0);\n",
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
        "point": lambda l: (
            f"void light l 0 0 3 {text(np.array(rgb(l['intensity'])) / math.pi / SMALL**2)}\n"
            f"l sphere p 0 0 4 {text(l['position'])} {SMALL}\n"
        ),
        "directional": lambda l: (
            f"void light l 0 0 3 {text(np.array(rgb(l['irradiance'])) / disc)}\n"
            f"l source p 0 0 4 {text(-np.array(l['direction']))} {SUN}\n"
        ),
        # The direction is as long as the point lies behind the lamp from which its light spreads.
        "spot": lambda l: (
            f"void spotlight l 0 0 7 {text(np.array(rgb(l['intensity'])) / math.pi / SMALL**2)} "
            f"60 {text(SMALL * axis(l))}\nl sphere p 0 0 4 {text(l['origin'])} {SMALL}\n"
        ),
        "constant": lambda l: (
            f"void glow k 0 0 4 {text(rgb(l['radiance']))} 0\nk source d 0 0 4 0 0 1 360\n"
        ),
    }
    said += "".join(words("Radiance", lamps, kind)(light) for kind, light in lights(scene))
    (folder / "s.rad").write_text(said, encoding="utf-8")
    angles = [2.0 * math.degrees(math.atan(half)) for half in (x, y)]
    view = f"-vtv -vp 0 0 0 -vd 0 0 -1 -vu 0 1 0 -vh {angles[0]} -vv {angles[1]}"
    rays = f"{programs}/vwrays -ff -pa 0 -pj 0 {view} -x {width} -y {height}"
    sky = any(kind == "constant" for kind, _ in lights(scene))
    exact = f"-dj 0 -ds 0.02 -dt 0 -ab {int(sky)} -aa 0 -ad 1024 -lr 100 -lw 1e-9"
    steps = (
        f"{programs}/oconv s.rad > s.oct; {rays} | {programs}/rtrace -fff -h {exact} s.oct > s.raw"
    )
    run("sh", "-c", steps, folder=folder)
    yield np.fromfile(folder / "s.raw", np.float32).reshape(height, width, 3).astype(float)
