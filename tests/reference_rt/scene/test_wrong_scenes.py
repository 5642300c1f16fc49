"""Wrong scenes: a line with file, line, keys, what was expected and what is there."""

import numpy as np
import pytest
from command_line import invoke
from PIL import Image

import reference_rt as rt
from reference_rt.core.exr import write_exr
from reference_rt.util import yaml_text
from reference_rt.util.errors import MOST_TOLD

SHAPE = "shapes:\n  - type: sphere\n    "
BOX = "shapes:\n  - type: box\n    transform: "
STEP = "expected one of 'translate', 'scale', 'rotate', 'matrix'"
LIGHT = "lights:\n  - type: point\n    position: [0, 0, 0]\n    intensity: "
METAL = "type: rough_conductor, eta: 1, k: 1"
BRIGHT = "textures: {t: {type: bitmap, file: bright.exr}}\n"
CHECKS = "textures: {t: {type: checker}}\n"
SPOT = "type: spot, origin: [0, 0, 0], target: [0, 0, 1], intensity: 1"
MAP = "type: environment_map, file: "

# (scene, line, keys, how the rest begins .. and ends)
SCENES = [
    ("film: {}\ncolour: 3", 2, "colour", "unknown key"),
    (SHAPE + "colour: 3", 3, "shapes[0].colour", "unknown key"),
    ("film: {width: 4.5}", 1, "film.width", "expected a whole number, got 4.5"),
    ("film: {width: '4'}", 1, "film.width", "expected a whole number, got '4'"),
    ("film: {width: true}", 1, "film.width", "expected a whole number, got True"),
    ("film: 7", 1, "film", "expected keys with values .. got 7"),
    ("film: [1]", 1, "film", "expected keys with values"),
    ("shapes: {a: 1}", 1, "shapes", "expected a list, got "),
    ("film:\n  width: 0", 2, "film.width", "expected greater than or equal to 1, got 0"),
    ("film: {width: 1" + "0" * 400 + "}", 1, "film.width", "expected less than"),
    (SHAPE + "radius: -1", 3, "shapes[0].radius", "expected greater than 0"),
    (SHAPE + "radius: .nan", 3, "shapes[0].radius", "expected a finite number, got nan"),
    (SHAPE + "radius: .inf", 3, "shapes[0].radius",
     "expected a finite number, got inf"),
    (SHAPE + "radius: 1e400", 3, "shapes[0].radius", "expected a finite number"),
    (SHAPE + "center: [0, .nan, 0]", 3, "shapes[0].center[1]",
     "expected a finite"),
    (SHAPE + "center: [1" + "0" * 400 + ", 0, 0]", 3, "shapes[0].center",
     "expected finite"),
    (SHAPE + "center: [1, 2]", 3, "shapes[0].center", "expected three numbers .. got [1, 2]"),
    (SHAPE + "radius: one", 3, "shapes[0].radius", "expected a number, got 'one'"),
    (LIGHT + ".nan", 4, "lights[0].intensity", "expected numbers of at least 0"),
    (LIGHT + ".inf", 4, "lights[0].intensity", "expected a finite number"),
    (LIGHT + "-1", 4, "lights[0].intensity", "expected numbers of at least 0"),
    ("lights:\n  - {type: point, intensity: 1}", 2, "lights[0].position", "missing"),
    ("camera: {type: fisheye}", 1, "camera",
     "unknown type 'fisheye'; expected one of: "),
    ("materials:\n  a: {reflectance: 1}", 2, "materials.a",
     "missing 'type'; expected"),
    (BOX + "[{scale: [1, 0, 1]}]", 2, "shapes[0]", "the transform is singular"),
    (BOX + "[{matrix: [[1, 2, 0, 0], [2, 4, 0, 0], [0, 0, 1, 0]]}]", 2, "shapes[0]",
     "the transform is singular"),
    (BOX + "[1]", 3, "shapes[0].transform[0]", STEP),
    (BOX + "[[1, 2]]", 3, "shapes[0].transform[0]", STEP),
    (BOX + "[null]", 3, "shapes[0].transform[0]", STEP),
    (BOX + "[{skew: 1}]", 3, "shapes[0].transform[0]", STEP),
    (BOX + "{scale: 2}", 3, "shapes[0].transform", "expected a list"),
    (BOX + "[{rotate: {axis: [0, 0, 0], degrees: 3}}]", 3,
     "shapes[0].transform[0].rotate.axis", "expected a direction"),
    (BOX + "[{matrix: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, .nan, 0]]}]", 3,
     "shapes[0].transform[0].matrix[2][2]", "expected a finite"),
    ("shapes:\n  - {type: triangle, v0: [0, 0, 0], v1: [1, 1, 1], v2: [2, 2, 2]}",
     2, "shapes[0]", "the triangle has no area; expected"),
    ("materials: {red: {type: mirror}}\n" + SHAPE + "material: blue", 4,
     "shapes[0].material", "there is no material 'blue'; expected one of: 'red'"),
    ("materials:\n  a: {type: emissive, radiance: 1, base: c}", 2,
     "materials.a.base", "there is no material 'c'; expected one of: 'a'"),
    ("materials:\n  a: {type: emissive, radiance: 1, base: b}\n"
     "  b: {type: emissive, radiance: 1}", 2, "materials.a.base",
     "'b' is emissive itself; expected"),
    ("materials:\n  a: {type: emissive, radiance: 1, base: a}", 2,
     "materials.a.base", "'a' is emissive itself; expected"),
    ("integrator: {type: path}\nsampler: {type: grid}", 2, "sampler.type",
     "'path' needs random numbers, which 'grid' does not have; expected"),
    ("integrator: {type: direct, light_samples: 0, shadows: false}", 1, "integrator",
     "no shadows and no samples of lights; expected light_samples above 0"),
    ("integrator: {type: direct}\nsampler: {type: grid}\n"
     "lights:\n  - {type: constant, radiance: 1}",
     4, "lights[0]", "'direct' needs random numbers for the light 'constant'"),
    ("integrator: {type: direct}\nsampler: {type: grid}\nmaterials:\n"
     "  lamp: {type: emissive, radiance: 1}",
     4, "materials.lamp", "'direct' needs random numbers for the light 'emissive'"),
    ("sampler: {type: grid, spp: 3}", 1, "sampler.spp",
     "expected a square number .. got 3"),
    ("camera: {type: perspective, target: [0, 0, 1]}", 1, "camera",
     "eye and target are the same point; expected"),
    ("camera: {type: perspective, up: [0, 0, 2]}", 1, "camera",
     "up is parallel to the view direction; expected"),
    (
     "camera: {type: perspective, eye: [1.0e308, 0, 0], target: [-1.0e308, 0, 0]}", 1, "camera",
     "eye and target are too far apart; expected"),
    ("camera: {type: perspective, fov: 180}", 1, "camera.fov",
     "expected less than 180, got 180"),
    ("integrator: {type: whitted, max_depth: 5000}", 1, "integrator.max_depth",
     "expected less than or equal to 4096"),
    ("", 1, "", "expected keys such as"),
    ("- 1", 1, "", "expected keys such as"),
    ("film:\n  filter: [1, 2", 3, "",
     "malformed: while parsing a flow sequence, did"),
    ("film: {width: 4}\nfilm: {width: 5}", 2, "",
     "malformed: found duplicate key 'film'"),
    ("film: {}\n---\nfilm: {}", 2, "",
     "malformed: expected a single document in the stream, but found another"),
    ("shapes: *b", 1, "", "malformed: found undefined alias"),
    ("film: !!python/object/apply:os.system ['exit 1']", 1, "",
     "malformed: unknown tag '!!python/"),
    ("film: !!python/name:os.system", 1, "", "malformed: unknown tag '!!python/"),
    ("shapes: &a [*a]", 1, "", "malformed: the alias 'a' is inside its"),
    ("description: !!float xyz", 1, "",
     "malformed: 'xyz' is no 'float', as its tag says"),
    ("description: " + "9" * 5000, 1, "", "malformed: Exceeds the limit"),
    ("film: " + "[" * 5000 + "]" * 5000, 1, "", "malformed: nested too deeply"),
    ('description: "\x07"', 1, "", "malformed: control characters are"),
    ("camera: {type: perspective, up: [0, 0, 0]}", 1, "camera.up",
     "expected a direction .. got [0, 0, 0]"),
    ("camera: {type: perspective, view: [1, 2, 3]}", 1, "camera.view",
     "expected four numbers .. got [1, 2, 3]"),
    ("film: {layers: [albedo, albedo]}", 1, "film.layers",
     "'albedo' is named twice .. got ['albedo', 'albedo']"),
    ("film: {layers: [ghosts]}", 1, "film.layers[0]", "expected 'albedo', 'normal' .. 'ghosts'"),
    ("integrator: path", 1, "integrator", "expected keys with values .. got 'path'"),
    (BOX + "5", 3, "shapes[0].transform", "expected a list, got 5"),
    (BOX + "[{scale: [1, 2]}]", 3, "shapes[0].transform[0].scale",
     "expected three numbers .. got [1, 2]"),
    (BOX + "[{matrix: [1, 2]}]", 3, "shapes[0].transform[0].matrix",
     "expected three rows .. got [1, 2]"),
    ("shapes: [{type: union, of: []}]", 1, "shapes[0].of", "expected at least 1 item, got 0"),
    ("shapes: [{type: cylinder, z_min: 2, z_max: 1}]", 1, "shapes[0]",
     "expected 'z_min' below 'z_max', got 2 and 1"),
    ("shapes: [{type: quadric, coefficients: [1, 2], lower: [0, 0, 0], upper: [1, 1, 1]}]", 1,
     "shapes[0].coefficients", "expected ten numbers .. got [1, 2]"),
    ("hierarchy: octree", 1, "hierarchy", "expected 'auto', .. got 'octree'"),
    (LIGHT + "bright", 4, "lights[0].intensity", "expected one number or three .. got 'bright'"),
    ("shapes: [{type: spheres}]", 1, "shapes[0]", "unknown type .. did you mean 'sphere'?"),
    ("shapse: []", 1, "shapse", "unknown key .. did you mean 'shapes'?"),
    ("integrator: {type: pathh}", 1, "integrator", "unknown type .. did you mean 'path'?"),
    ("materials: {grey: {type: diffuse}}\nshapes: [{type: sphere, material: gray}]", 2,
     "shapes[0].material", "there is no material 'gray' .. did you mean 'grey'?"),
    ("textures: {wood: {type: checker}}\nmaterials: {m: {type: diffuse, reflectance: wod}}", 2,
     "materials.m.reflectance", "there is no texture 'wod' .. did you mean 'wood'?"),
    ("groups: {tree: [{type: sphere}]}\nshapes: [{type: instance, group: trees}]", 2,
     "shapes[0].group", "there is no group 'trees' .. did you mean 'tree'?"),
    ("lights:\n  - {type: constant, radiance: 1}\n  - {type: environment_map, file: image.png}", 1,
     "lights", "more than one environment; expected at most one"),
    ("integrator: {type: direct, light_samples: 0, bsdf_samples: 0}", 1, "integrator",
     "no samples at all; expected light_samples or bsdf_samples above 0"),
    ("integrator: {type: path, sampling: all}", 1, "integrator.sampling",
     "expected 'both', 'lights'"),
    ("film: {filter: {type: mitchell, b: 2}}", 1, "film.filter.b",
     "expected less than or equal to 1"),
    ("film: {filter: {type: lanczos, lobes: 0}}", 1, "film.filter.lobes",
     "expected greater than or "),
    ("shapes: [{type: rectangle, transform: [{scale: 1.0e-200}]}]", 1, "shapes[0]",
     "the rectangle's area is not a float64; expected"),
    ("textures: {t: {type: bitmap, file: none.png}}", 1, "textures.t", "none.png: cannot be read"),
    ("textures: {t: {type: bitmap, file: nan.exr}}", 1, "textures.t",
     "nan.exr: the pixel at column 2, row 1 is not finite; expected"),
    ("textures: {t: {type: bitmap, file: bright.exr, scale: 1.0e+308}}", 1, "textures.t",
     "bright.exr: a colour times the scale overflows; expected a smaller scale"),
]  # fmt: skip

# Of a material m: (its text, the rest of the keys, the fact)
MATERIALS = [
    ("type: diffuse, reflectance: 1.5", ".reflectance", "expected numbers from 0 to 1 .. got 1.5"),
    ("type: diffuse, reflectance: [0, 1.0001, 0]", ".reflectance", "expected numbers from 0 to 1"),
    ("type: diffuse, reflectance: .nan", ".reflectance", "expected numbers of at least 0"),
    ("type: diffuse, reflectance: true", ".reflectance", "expected one number or three"),
    ("type: diffuse, reflectance: wood", ".reflectance", "there is no texture 'wood'; expected"),
    ("type: diffuse, alpha: 1", ".alpha", "unknown key; expected one of: type, reflectance"),
    ("type: velvet", "", "unknown type 'velvet'; expected one of: diffuse, mirror, dielectric,"),
    ("type: mirror, reflectance: 2", ".reflectance", "expected numbers from 0 to 1"),
    ("type: plastic, specular: 2", ".specular", "expected numbers from 0 to 1"),
    ("type: plastic, specular: -0.1", ".specular", "expected numbers of at least 0"),
    ("type: plastic, reflectance: 1.1", ".reflectance", "expected numbers from 0 to 1"),
    ("type: plastic, interior_ior: 0", ".interior_ior", "expected greater than 0, got 0"),
    ("type: plastic, exterior_ior: .nan", ".exterior_ior", "expected a finite number, got nan"),
    ("type: plastic, nonlinear: 1", ".nonlinear", "expected a valid boolean, got 1"),
    ("type: plastic, alpha: 0.1", ".alpha", "unknown key; expected one of: type, reflectance"),
    ("type: rough_plastic, nonlinear: 1", ".nonlinear", "expected a valid boolean, got 1"),
    ("type: rough_plastic, alpha: [0.1, 0.2]", ".alpha", "expected a number"),
    ("type: dielectric, transmittance: 2", ".transmittance", "expected numbers from 0 to 1"),
    ("type: dielectric, interior_ior: 0", ".interior_ior", "expected greater than 0, got 0"),
    ("type: dielectric, interior_ior: .nan", ".interior_ior", "expected a finite number, got nan"),
    ("type: thin_dielectric, exterior_ior: -1", ".exterior_ior", "expected greater than 0, got -1"),
    ("type: thin_dielectric, interior_ior: .nan", ".interior_ior", "expected a finite number"),
    ("type: thin_dielectric, reflectance: 1.1", ".reflectance", "expected numbers from 0 to 1"),
    ("type: thin_dielectric, transmittance: [0, 0, -1]", ".transmittance", "expected numbers of"),
    ("type: rough_plastic, interior_ior: .inf", ".interior_ior", "expected a finite number"),
    ("type: conductor, eta: [1, 0, 1], k: 1", ".eta", "expected indices of refraction above 0"),
    ("type: conductor, eta: .nan, k: 1", ".eta", "expected numbers of at least 0"),
    ("type: conductor, eta: 1, k: -1", ".k", "expected numbers of at least 0"),
    ("type: conductor, eta: 1", ".k", "missing; expected a value"),
    ("type: conductor, k: 1", ".eta", "missing; expected a value"),
    ("type: conductor, eta: 0, k: 1", ".eta", "expected indices of refraction above 0, got 0"),
    ("type: conductor, eta: -1, k: 1", ".eta", "expected numbers of at least 0"),
    ("type: conductor, eta: 1, k: .nan", ".k", "expected numbers of at least 0"),
    ("type: conductor, eta: 1, k: [1, 2]", ".k", "expected one number or three .. got [1, 2]"),
    ("type: conductor, eta: 1, k: 1, reflectance: 1.1", ".reflectance", "expected numbers from 0"),
    ("type: rough_conductor, eta: 0, k: 1", ".eta", "expected indices of refraction above 0"),
    ("type: rough_conductor, eta: 1, k: -1", ".k", "expected numbers of at least 0"),
    ("type: rough_dielectric, interior_ior: 0", ".interior_ior", "expected greater than 0, got 0"),
    ("type: rough_dielectric, exterior_ior: .nan", ".exterior_ior", "expected a finite number"),
    ("type: rough_dielectric, interior_ior: 1", "", "interior_ior and exterior_ior are equal: "),
    ("type: rough_dielectric, transmittance: 1.5", ".transmittance", "expected numbers from 0 to"),
    (METAL + ", alpha: 0", ".alpha", "expected a roughness above 0 and at most 10, got 0"),
    (METAL + ", alpha: -0.1", ".alpha", "expected a roughness above 0 and at most 10, got -0.1"),
    (METAL + ", alpha: [0.1, 0]", ".alpha", "expected a roughness above 0 and at most 10, got 0"),
    (METAL + ", alpha: [1, 2, 3]", ".alpha", "expected a number, two of them [alpha_u, alpha_v]"),
    (METAL + ", alpha: .nan", ".alpha", "expected a roughness above 0 and at most 10, got nan"),
    (METAL + ", distribution: phong", ".distribution", "expected 'ggx' or 'beckmann', got 'phong'"),
    ("type: rough_plastic, alpha: 0", ".alpha", "expected greater than 0, got 0"),
    ("type: rough_dielectric, alpha: -1", ".alpha", "expected a roughness above 0"),
    ("type: principled, roughness: -0.1", ".roughness", "expected a number from 0 to 1"),
    ("type: principled, base_colour: 2", ".base_colour", "expected numbers from 0 to 1"),
    ("type: principled, eta: 0", ".eta", "expected greater than 0, got 0"),
    ("type: principled, eta: 2, specular: 0", "", "specular and eta both give the index"),
    ("type: gltf_pbr, metallic: 1.5", ".metallic", "expected a number from 0 to 1"),
    ("type: gltf_pbr, ior: -1", ".ior", "expected greater than or equal to 0, got -1"),
    ("type: phong, diffuse: 0.1, exponent: 0", ".exponent", "expected greater than 0, got 0"),
    ("type: phong, diffuse: -1", ".diffuse", "expected numbers of at least 0"),
    (
        "type: phong, diffuse: 1",
        "",
        "creates energy: up to 3.142 of the light comes back; expected",
    ),
    ("type: phong, diffuse: 0.1, specular: [1, 2]", ".specular", "expected one number or three"),
    ("type: phong, diffuse: 0.1, exponent: .inf", ".exponent", "expected a finite number, got inf"),
    ("type: phong, diffuse: 0.1, mirror: .nan", ".mirror", "expected numbers of at least 0"),
    ("type: phong, diffuse: 0.1, half_vector: 1", ".half_vector", "expected a valid boolean"),
    ("type: phong", ".diffuse", "missing; expected a value"),
    ("type: emissive, radiance: -1", ".radiance", "expected numbers of at least 0"),
    ("type: emissive, radiance: .inf", ".radiance", "expected a finite number, got inf"),
    ("type: mask, base: b", ".base", "there is no material 'b'; expected one of: 'm'"),
    ("type: mask, base: m, opacity: 2", ".opacity", "expected a number from 0 to 1, got 2"),
    ("type: mask, base: m", "", "contains itself: m -> m"),
    ("type: two_sided, base: m", "", "contains itself: m -> m"),
    ("type: blend, first: m, second: m, weight: -1", ".weight", "expected a number from 0 to 1"),
    ("type: blend, first: m, second: m, weight: .nan", ".weight", "expected a number from 0 to 1"),
    ("type: bump, base: m", ".height", "missing; expected a value"),
    ("type: bump, base: m, height: t", ".height", "there is no texture 't'; expected one of: none"),
    (
        "type: normal_map, base: m, normals: 3",
        ".normals",
        "expected the name of one of 'textures', got 3",
    ),
]

# (what stands before it, the material m and others, the rest of the keys, the fact)
TOGETHER = [
    (BRIGHT, "{type: diffuse, reflectance: t}", "", "the texture 't' has values up to 3; expected"),
    (BRIGHT, "{type: principled, roughness: t}", "", "the texture 't' has values up to 3"),
    (BRIGHT, "{type: phong, diffuse: t}", "", "creates energy: up to 9.425 of the light"),
    (BRIGHT, "{type: mask, base: b, opacity: t}\n  b: {type: mirror}", "", "the texture 't' has"),
    ("", "{type: mask, base: b}\n  b: {type: emissive, radiance: 1}", ".base", "'b' is emissive"),
    ("", "{type: two_sided, base: b}\n  b: {type: dielectric}", "", "'b' lets light pass;"),
    (CHECKS, "{type: mask, base: b}\n  b: {type: bump, base: m, height: t}", "", "contains itself"),
    ("", "{type: blend, first: b, second: c}\n  b: {type: mirror}\n  c: {type: two_sided, base: m}",
     "", "contains itself: m -> c -> m"),
    (CHECKS, "{type: bump, base: b, height: t}\n  b: {type: normal_map, base: c, normals: t}\n"
     "  c: {type: mirror}", "", "'b' is tilted already; expected one map at most"),
]  # fmt: skip

LIGHTS = [
    ("type: laser", "", "unknown type 'laser'; expected one of: point, spot, goniometric,"),
    ("type: constant, radiance: t", ".radiance", "expected one number or three [r, g, b]"),
    ("type: ambient, radiance: .nan", ".radiance", "expected numbers of at least 0"),
    ("type: directional, direction: [0, 0, 0], irradiance: 1", ".direction", "expected a"),
    ("type: directional, direction: [0, 0, 1], irradiance: -1", ".irradiance", "expected numbers"),
    ("type: spot, origin: [1, 2, 3], target: [1, 2, 3], intensity: 1", "", "origin and target give "
     "no direction; expected two different points"),
    (SPOT + ", cutoff_angle: 10, beam_width: 20", "", "beam_width 20 is more than cutoff_angle 10"),
    (SPOT + ", cutoff_angle: 0", ".cutoff_angle", "expected greater than 0, got 0"),
    (SPOT + ", cutoff_angle: 181", ".cutoff_angle", "expected less than or equal to 180, got 181"),
    (SPOT + ", cutoff_angle: -1", ".cutoff_angle", "expected greater than 0, got -1"),
    (SPOT + ", cutoff_angle: .nan", ".cutoff_angle", "expected a finite number, got nan"),
    ("type: spot, origin: [-1.0e308, 1.0e308, 0], target: [1.0e308, -1.0e308, 0], intensity: 1",
     "", "origin and target give no direction; expected two different points"),
    (SPOT + ", beam_width: -1", ".beam_width", "expected greater than or equal to 0, got -1"),
    ("type: environment_map", ".file", "missing; expected a value"),
    (MAP + "image.png, scale: 0", ".scale", "expected greater than 0"),
    (MAP + "image.png, transform: [{scale: 2}]", "", "the transform moves"),
    (MAP + "none.png", "", "none.png: cannot be read: No such file"),
    (MAP + "cut.png", "", "cut.png: cannot be read: "),
    (MAP + "row.png", "", "row.png: has one row of pixels; expected two"),
    (MAP + "black.exr", "", "black.exr: has no power; expected a pixel"),
    (MAP + "nan.exr", "", "nan.exr: the pixel at column 2, row 1 is not "
     "finite; expected finite ones"),
    (MAP + "minus.exr", "", "minus.exr: the pixel at column 2, row 1 is "
     "negative; expected values of at least 0"),
    (MAP + "bright.exr, scale: 1.0e+308", "", "bright.exr: a colour "
     "times the scale overflows; expected a smaller scale"),
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Image files, good and bad."""
    made = tmp_path_factory.mktemp("images")
    Image.fromarray(np.full((16, 16, 3), 200, np.uint8)).save(made / "image.png")
    Image.fromarray(np.full((1, 4, 3), 200, np.uint8)).save(made / "row.png")
    (made / "cut.png").write_bytes((made / "image.png").read_bytes()[:60])
    for name, value in (("black", 0.0), ("bright", 3.0), ("nan", np.nan), ("minus", -1.0)):
        planes = {c: np.full((3, 4), 0.0 if name == "black" else 3.0) for c in "RGB"}
        planes["G"][1, 2] = value
        write_exr(made / f"{name}.exr", planes, {})
    return made


def wrong_scenes():
    """(scene, line, keys, fact) of all tables."""
    yield from SCENES
    ball = "\nshapes: [{type: sphere, material: m}]"
    for text, keys, fact in MATERIALS:
        line = 2 if fact.startswith("missing") or keys == "" else 3
        yield f"materials:\n  m:\n    {{{text}}}{ball}", line, f"materials.m{keys}", fact
    for before, text, keys, fact in TOGETHER:
        line = 2 + before.count("\n")
        yield f"{before}materials:\n  m: {text}{ball}", line, f"materials.m{keys}", fact
    for text, keys, fact in LIGHTS:
        yield f"lights:\n  - {{{text}}}\nshapes: [{{type: sphere}}]", 2, f"lights[0]{keys}", fact


def test_each_is_refused_with_line_keys_and_fact(folder):
    """In one printable line, which repeats a value at most once."""
    file, failures = folder / "scene.yaml", []
    for text, line, keys, fact in wrong_scenes():
        file.write_text(text + "\n")
        try:
            rt.build_tables(rt.Scene.load(file))
            said = "nothing"
        except rt.SceneError as error:
            said = " ".join([str(error), *map(str, error.others)])
        begin, _, end = fact.partition(" .. ")
        told = said.removeprefix(f"{file}:{line}: " + (f"{keys}: " if keys else ""))
        told = told.replace(f"{folder}/", "")
        right = told != said and told.startswith(begin) and told.endswith(end)
        if not (right and said.isprintable() and said.count(", got ") <= 1):
            failures.append((text[:200], line, keys, fact, said))
    assert not failures


def test_the_program_ends_with_one_line(refused, folder, tmp_path):
    """Exit code 3, of an error of the text, of a value, of a file."""
    for text, line, keys in (
        ("film: [1", 2, "malformed: "),
        ("film:\n  width: 0", 2, "film.width: "),
        (f"lights:\n- {{type: environment_map, file: {folder}/row.png}}", 2, "lights[0]: "),
    ):
        file = tmp_path / "scene.yaml"
        file.write_text(text + "\n")
        said = refused(3, "render", str(file), "-o", str(tmp_path / "out.exr"), "--size", "4x4")
        assert said.startswith(f"{file}:{line}: {keys}")


def test_malformed_json_reports_the_line(tmp_path):
    for suffix in (".yaml", ".json"):
        file = tmp_path / f"scene{suffix}"
        file.write_text('{\n  "film": {"width": 4},\n  "camera": {]\n}\n')
        with pytest.raises(rt.SceneError, match=":3: malformed: "):
            rt.Scene.load(file)


def test_files_that_are_no_scenes(wording, tmp_path):
    (tmp_path / "scene.txt").write_text("film: {}")
    (tmp_path / "bin.yaml").write_bytes(bytes(range(128, 256)))
    (tmp_path / "folder.yaml").mkdir()
    for name in ("no.yaml", "scene.txt", "bin.yaml", "folder.yaml"):
        with pytest.raises(rt.SceneError) as caught:
            rt.Scene.load(tmp_path / name)
        wording(str(caught.value).replace(f"{tmp_path}/", ""))


def test_a_billion_laughs():
    """9^12 values through aliases, which nobody must unfold: it would never end."""
    laughs = ["description: &a0 [x, x, x, x, x, x, x, x, x]"]
    laughs += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    with pytest.raises(rt.SceneError, match=f":7: .* more than {yaml_text.MOST_REPEATED} values"):
        rt.Scene.parse("\n".join([*laughs, "shapes: *a11"]))


def test_tags_make_data_and_never_run(tmp_path):
    marker = tmp_path / "marker"
    with pytest.raises(rt.SceneError):
        rt.Scene.parse(f"film: !!python/object/apply:os.mkdir ['{marker}']")
    assert not marker.exists()


def test_errors_from_python_name_the_keys():
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene(shapes=(rt.Sphere(material="blue"),))
    assert caught.value.path == ("shapes", 0, "material")
    flat = rt.Scene(shapes=(rt.Sphere(), rt.Triangle(v0=(0, 0, 0), v1=(1, 0, 0), v2=(2, 0, 0))))
    with pytest.raises(rt.SceneError, match=r"^shapes\[1\]: the triangle has no area"):
        rt.build_tables(flat)
    with pytest.raises(rt.SceneError) as caught:
        rt.Film(width=0, height="tall", depth=3)
    paths = [one.path for one in (caught.value, *caught.value.others)]
    assert sorted(paths) == [("depth",), ("height",), ("width",)]


def test_long_values_are_shortened():
    long = {"a" * 1000: 1}, [[1] * 9] * 10**4, np.zeros(9)
    for value in ("x" * 10**6, list(range(10**5)), 10**4000, *long):
        with pytest.raises(rt.SceneError) as caught:
            rt.Sphere(center=value)
        assert len(str(caught.value)) < 200


def test_what_is_missing_or_unknown_has_no_value():
    with pytest.raises(rt.SceneError) as caught:
        rt.Point(position=(0, 0, 0))
    assert "got" not in caught.value.message
    with pytest.raises(rt.SceneError) as caught:
        rt.Sphere(centre=(0, 0, 0))
    assert caught.value.message.endswith("did you mean 'center'?")
    for text in ("shapes: [{type: velvet}]", "xyzzy: 1"):  # near nothing
        with pytest.raises(rt.SceneError) as caught:
            rt.Scene.parse(text)
        assert "did you mean" not in caught.value.message


# ---- several problems at once -------------------------------------------------------------------

BAD = """\
camera: {type: perspectiv, fov: 40}
film:
  widht: 320
  height: -1
materials:
  floor: {type: diffuse, reflectance: [1, 2]}
shapes:
  - {type: sphere, radius: big}
  - {type: sphere, radius: 1, centre: [0, 0, 0]}
"""


def test_every_problem_with_its_line(wording, tmp_path):
    """The program prints a line for each."""
    (tmp_path / "x.yaml").write_text(BAD, encoding="utf-8")
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene.load(tmp_path / "x.yaml")
    problems = [caught.value, *caught.value.others]
    assert sorted(one.line for one in problems) == [1, 3, 4, 6, 8, 9]
    for one in problems:
        wording(str(one).replace(f"{tmp_path}/", ""))
    done = invoke("explain", tmp_path / "x.yaml")
    assert done.exit_code == 3
    assert done.stderr.splitlines() == [f"error: {one}" for one in problems]


def test_a_mistake_in_many_places_is_told_a_few_times():
    shapes = "".join(f"  - {{type: sphere, radius: -{k + 1}}}\n" for k in range(500))
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene.parse(f"shapes:\n{shapes}")
    assert 1 + len(caught.value.others) == MOST_TOLD


# ---- nested materials ---------------------------------------------------------------------------


def test_energy_is_asked_of_paths_alone():
    """The textbook's shading is no law of nature; Whitted's integrator may have any of it."""
    bright = rt.Scene(
        materials={"m": rt.Phong(diffuse=(1, 1, 1))},
        shapes=(rt.Sphere(material="m"),),
        integrator=rt.Whitted(),
    )
    rt.build_tables(bright)
    with pytest.raises(rt.SceneError, match="creates energy"):
        rt.build_tables(bright.changed(integrator=rt.Path()))


def test_blends_that_double():
    """Refused at once, though thirty of them have a billion layers, in whatever order they are."""
    names = [f"m{k}" for k in range(30)]
    blends = {n: rt.Blend(first=b, second=b) for n, b in zip(names[1:], names, strict=False)}
    for order in (blends, dict(reversed(blends.items()))):
        with pytest.raises(rt.SceneError, match="'m7' has 128 layers; expected at most 64"):
            rt.Scene(materials=order | {"m0": rt.Diffuse()})


def test_endless_nesting():
    two = {f"m{k}": rt.TwoSided(base=f"m{k + 1}") for k in range(400)}
    with pytest.raises(rt.SceneError, match="nested too deeply; expected at most 64 materials"):
        rt.Scene(materials=two | {"m400": rt.Diffuse()})
