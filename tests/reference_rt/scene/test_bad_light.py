"""Wrong materials, textures and lights: exit code 3 and one line with file, line, keys and what was
expected; what is merely dark is a picture."""

import numpy as np
import pytest
from PIL import Image

import reference_rt as rt
from reference_rt.core.exr import write_exr

BALL = "shapes: [{type: sphere, material: m}]\n"
METAL = "type: rough_conductor, eta: 1, k: 1"
BRIGHT = "textures: {t: {type: bitmap, file: bright.exr}}\n"
CHECKS = "textures: {t: {type: checker}}\n"
SPOT = "type: spot, origin: [0, 0, 0], target: [0, 0, 1], intensity: 1"

# Of a material m: (its text, the rest of the keys, the beginning of the rest)
MATERIALS = [
    ("type: diffuse, reflectance: 1.5", ".reflectance", "expected numbers from 0 to 1: more would"),
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
    ("type: rough_plastic, alpha: [0.1, 0.2]", ".alpha", "expected a valid number"),
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
    ("type: conductor, eta: 1, k: [1, 2]", ".k", "expected one number or three"),
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
    ("type: mask, base: m, opacity: 2", ".opacity", "expected a number from 0 to 1"),
    ("type: mask, base: m", "", "contains itself: m -> m"),
    ("type: two_sided, base: m", "", "contains itself: m -> m"),
    ("type: blend, first: m, second: m, weight: -1", ".weight", "expected a number from 0 to 1"),
    ("type: blend, first: m, second: m, weight: .nan", ".weight", "expected a number from 0 to 1"),
    ("type: bump, base: m", ".height", "missing; expected a value"),
    ("type: bump, base: m, height: t", ".height", "there is no texture 't'; expected one of: none"),
    ("type: normal_map, base: m, normals: 3", ".normals", "expected a valid string, got 3"),
]

# (what stands before it, the material m and others, the rest of the keys, beginning of the rest)
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
    ("type: laser", "", "unknown type 'laser'; expected one of: point, spot, projector,"),
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
    ("type: environment_map, file: image.png, scale: 0", ".scale", "expected greater than 0"),
    ("type: environment_map, file: image.png, transform: [{scale: 2}]", "", "the transform moves"),
    ("type: environment_map, file: none.png", "", "none.png: cannot be read: No such file"),
    ("type: environment_map, file: cut.png", "", "cut.png: cannot be read: "),
    ("type: environment_map, file: row.png", "", "row.png: has one row of pixels; expected two"),
    ("type: environment_map, file: black.exr", "", "black.exr: has no power; expected a pixel"),
    ("type: environment_map, file: nan.exr", "", "nan.exr: the pixel at column 2, row 1 is not "
     "finite; expected finite ones"),
    ("type: environment_map, file: minus.exr", "", "minus.exr: the pixel at column 2, row 1 is "
     "negative; expected values of at least 0"),
    ("type: environment_map, file: bright.exr, scale: 1.0e+308", "", "bright.exr: a colour "
     "times the scale overflows; expected a smaller scale"),
]  # fmt: skip

# (scene, keys, beginning of the rest)
REST = [
    ("lights:\n  - {type: constant, radiance: 1}\n  - {type: environment_map, file: image.png}",
     "lights", "more than one environment; expected at most one"),
    ("integrator: {type: direct, light_samples: 0, bsdf_samples: 0}", "integrator", "no samples at "
     "all; expected light_samples or bsdf_samples above 0"),
    ("integrator: {type: path, sampling: all}", "integrator.sampling", "expected 'both', 'lights'"),
    ("integrator: {type: direct}\nsampler: {type: grid}", "sampler.type", "'direct' needs random"),
    ("film: {layers: [ghosts]}", "film.layers[0]", "expected 'albedo', 'normal', 'position'"),
    ("film: {filter: {type: mitchell, b: 2}}", "film.filter.b", "expected less than or equal to 1"),
    ("film: {filter: {type: lanczos, lobes: 0}}", "film.filter.lobes", "expected greater than or "),
    ("shapes: [{type: rectangle, transform: [{scale: 1.0e-200}]}]", "shapes[0]", "the rectangle's "
     "area is not a float64; expected"),
    ("textures: {t: {type: bitmap, file: none.png}}", "textures.t", "none.png: cannot be read"),
    ("textures: {t: {type: bitmap, file: nan.exr}}", "textures.t", "nan.exr: the pixel at column "
     "2, row 1 is not finite; expected"),
    ("textures: {t: {type: bitmap, file: bright.exr, scale: 1.0e+308}}", "textures.t",
     "bright.exr: a colour times the scale overflows; expected a smaller scale"),
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


def expect(refused, folder, text, line, keys, rest):
    """That the scene is refused with this line, keys and rest."""
    file = folder / "scene.yaml"
    file.write_text(text)
    said = refused(3, "render", str(file), "-o", str(folder / "out.exr"), "--size", "4x4")
    assert said.startswith(f"{file}:{line}: {keys}: ")
    told = said.removeprefix(f"{file}:{line}: {keys}: ").replace(f"{folder}/", "")
    assert told.startswith(rest)
    assert not (folder / "out.exr").exists()


@pytest.mark.parametrize(("text", "keys", "rest"), MATERIALS, ids=[m[0] for m in MATERIALS])
def test_materials(text, keys, rest, refused, folder):
    line = 2 if rest.startswith("missing") or keys == "" else 3
    text = "materials:\n  m:\n    {" + text + "}\n" + BALL
    expect(refused, folder, text, line, f"materials.m{keys}", rest)


@pytest.mark.parametrize(("before", "text", "keys", "rest"), TOGETHER, ids=[t[1] for t in TOGETHER])
def test_materials_and_what_they_name(before, text, keys, rest, refused, folder):
    line = 2 + before.count("\n")
    text = before + "materials:\n  m: " + text + "\n" + BALL
    expect(refused, folder, text, line, f"materials.m{keys}", rest)


@pytest.mark.parametrize(("text", "keys", "rest"), LIGHTS, ids=[t[0] for t in LIGHTS])
def test_lights(text, keys, rest, refused, folder):
    text = "lights:\n  - {" + text + "}\n" + "shapes: [{type: sphere}]\n"
    expect(refused, folder, text, 2, f"lights[0]{keys}", rest)


@pytest.mark.parametrize(("text", "keys", "rest"), REST, ids=[r[0] for r in REST])
def test_scenes(text, keys, rest, refused, folder):
    line = 2 if keys == "sampler.type" else 1
    expect(refused, folder, text + "\n", line, keys, rest)


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


# ---- light that is none, and too much of it -----------------------------------------------------

DARK = {
    "point": {"lights": (rt.Point(position=(0, 3, 0), intensity=(0, 0, 0)),)},
    "spot": {"lights": (rt.Spot(origin=(0, 3, 0), target=(0, 0, 0), intensity=(0, 0, 0)),)},
    "directional": {"lights": (rt.Directional(direction=(0, -1, 0), irradiance=(0, 0, 0)),)},
    "constant": {"lights": (rt.Constant(radiance=(0, 0, 0)),)},
    "ambient": {"lights": (rt.Ambient(radiance=(1, 1, 1)),)},
    "lamp": {"shapes": (rt.Sphere(center=(0, 3, 0), material="dark"), rt.Sphere())},
    "no area": {"shapes": (rt.Sphere(radius=1e-200, material="lamp"), rt.Sphere())},
}


@pytest.mark.parametrize("name", DARK)
def test_a_light_without_power_or_area_is_never_picked(name):
    scene = rt.Scene(
        **{"shapes": (rt.Sphere(),)} | DARK[name],
        materials={
            "dark": rt.Emissive(radiance=(0, 0, 0)),
            "lamp": rt.Emissive(radiance=(1, 1, 1)),
        },
    )
    assert scene.tables.lights.choice is None
    bright = rt.Point(position=(0, 5, 0), intensity=(1, 1, 1))
    scene = scene.changed(lights=(bright, *scene.lights))
    chance = scene.tables.lights.choice.probability
    assert sorted(chance) == [0.0] * (len(chance) - 1) + [1.0]


def test_a_dark_lamp_is_black():
    """Also to paths that hit it, and as the only light."""
    scene = rt.Scene(
        film=rt.Film(width=4, height=4),
        sampler=rt.Sobol(spp=4),
        materials={"dark": rt.Emissive(radiance=(0, 0, 0), base="grey"), "grey": rt.Diffuse()},
        shapes=(rt.Sphere(material="dark"), rt.Sphere(center=(0, 3, 0), material="dark")),
    )
    with pytest.warns(rt.SceneWarning, match="every light has radiance or intensity 0"):
        assert not rt.render(scene).colour.any()


@pytest.mark.parametrize(
    "lights",
    [
        (rt.Point(position=(0, 5, 0), intensity=(1e308, 1e308, 1e308)),) * 2,
        (rt.Directional(direction=(0, -1, 0), irradiance=(1e308, 1e308, 1e308)),) * 2,
        (rt.Constant(radiance=(1e308, 1e308, 1e308)), rt.Point(position=(0, 5, 0), intensity=1)),
        (rt.Point(position=(0, 5, 0), intensity=(1e308, 1e308, 1e308)),) * 9,
        (rt.Spot(origin=(0, 5, 0), target=(0, 0, 0), intensity=(1, 1, 1), cutoff_angle=1e-9),) * 2,
    ],
    ids=["point", "directional", "constant", "tree", "thin"],
)
def test_probabilities_of_extremes(lights):
    """They add to 1, where powers overflow or a beam is thinner than rounding."""
    scene = rt.Scene(shapes=(rt.Sphere(),), lights=lights)
    chance = scene.tables.lights.choice.probability
    assert len(chance) == len(lights)
    assert (chance >= 0.0).all()
    assert chance.sum() == pytest.approx(1.0)
