"""`convert -o scene.pbrt`: the grammar of pbrt-v4, and what film, lights, materials and textures of
the written file mean."""

from pathlib import Path

import numpy as np
import OpenEXR
import pbrt_reader
import pytest
from builders import SCENES
from command_line import invoke
from pbrt_reader import scene_of, written

import reference_rt as rt
from comparisons.pbrt import write_pbrt
from reference_rt.core.vec3 import Vec3
from reference_rt.lights.emitters import environment_map
from reference_rt.util.errors import SceneError

# ---- film, sampler, integrator -------------------------------------------------------------------


def profile(plugin: str, params: dict, x: np.ndarray) -> np.ndarray:
    """pbrt's filters, by its book's formulas (PBR 4ed, 8.8), on one axis."""
    (r,) = params["float xradius"]
    assert params["float yradius"] == [r]
    if plugin == "box":
        found = np.ones_like(x)
    elif plugin == "triangle":
        found = r - np.abs(x)
    elif plugin == "gaussian":
        (s,) = params["float sigma"]
        found = np.exp(-x * x / (2 * s * s)) - np.exp(-r * r / (2 * s * s))
    elif plugin == "mitchell":
        (b,), (c,) = params["float B"], params["float C"]
        y = np.abs(2 * x / r)
        near = (12 - 9 * b - 6 * c) * y**3 + (-18 + 12 * b + 6 * c) * y**2 + (6 - 2 * b)
        far = (
            (-b - 6 * c) * y**3 + (6 * b + 30 * c) * y**2 + (-12 * b - 48 * c) * y + 8 * b + 24 * c
        )
        found = np.where(y < 1, near, far)
    else:
        assert plugin == "sinc"
        found = np.sinc(x) * np.sinc(x / params["float tau"][0])
    return np.where(np.abs(x) < r, found, 0.0)


@pytest.mark.parametrize(
    "given",
    [
        {"type": "box"},
        {"type": "tent", "radius": 1.3},
        {"type": "gaussian", "stddev": 0.4},
        {"type": "mitchell", "b": 0.2, "c": 0.4},
        {"type": "catmull_rom"},
        {"type": "lanczos", "lobes": 2},
    ],
    ids=lambda given: given["type"],
)
def test_filters_are_ours(given, tmp_path):
    scene = scene_of(film={"width": 8, "height": 4, "filter": given})
    file = written(scene, tmp_path)
    plugin, params = file.options["PixelFilter"]
    x = np.linspace(-3.0, 3.0, 6001)
    theirs = profile(plugin, params, x)
    theirs /= theirs.sum() * (x[1] - x[0])
    ours = np.array([scene.film.filter.value(at) for at in x])
    # Off where a box ends: one step of the sum.
    np.testing.assert_allclose(theirs[::7], ours[::7], atol=2e-3)


@pytest.mark.parametrize(
    ("integrator", "depth"),
    [
        ({"type": "path", "max_depth": 1}, 0),
        ({"type": "path", "max_depth": 6}, 5),
        ({"type": "path"}, 2**31 - 1),
        ({"type": "direct"}, 1),
    ],
)
def test_options(integrator, depth, tmp_path):
    sampler = {"type": "independent", "spp": 24, "seed": 2**31 + 5}
    film = {"width": 48, "height": 32}
    scene = scene_of(integrator=integrator, sampler=sampler, film=film)
    options = written(scene, tmp_path).options
    expected = {"integer maxdepth": [depth], "bool regularize": [False]}
    assert options["Integrator"] == ("path", expected)
    assert options["Sampler"] == (
        "independent",
        {"integer pixelsamples": [24], "integer seed": [5]},
    )
    # The sensor's factor is exposure time x ISO / 100, and the shutter is open from 0 to 1.
    assert (
        options["Film"][1].items()
        >= {
            "string filename": ["out.exr"],
            "integer xresolution": [48],
            "integer yresolution": [32],
            "string sensor": ["cie1931"],
            "float iso": [100.0],
            "bool savefp16": [False],
        }.items()
    )


# ---- lights --------------------------------------------------------------------------------------


def test_lights(tmp_path):
    lights = [
        {"type": "point", "position": [1, 2, 3], "intensity": [4, 5, 6]},
        {"type": "directional", "direction": [0, -2, 1], "irradiance": 3},
        {"type": "constant", "radiance": [0.1, 0.2, 0.3]},
        {"type": "ambient", "radiance": 1},
        {
            "type": "spot", "origin": [0, 3, 0], "target": [0, 0, 1], "intensity": 2,
            "cutoff_angle": 25, "beam_width": 25,
        },
    ]  # fmt: skip
    found = written(scene_of(lights=lights), tmp_path).lights
    from_, to = "point3 from", "point3 to"
    cone = {"float coneangle": [25.0], "float conedeltaangle": [0.0]}
    assert found == [
        ("point", {"rgb I": [4, 5, 6], from_: [1, 2, 3]}),
        ("distant", {"rgb L": [3, 3, 3], from_: [0, 0, 0], to: [0, -2, 1]}),
        ("infinite", {"rgb L": [0.1, 0.2, 0.3]}),
        ("spot", {"rgb I": [2, 2, 2], from_: [0, 3, 0], to: [0, 0, 1], **cone}),
    ]


def square_of(d: np.ndarray) -> np.ndarray:
    """The point of Clarberg's square for unit directions, by its definition: equal areas, z = 1 in
    the middle, z = 0 on the diagonals, and the azimuth in proportion along each edge."""
    r = np.sqrt(1.0 - np.abs(d[:, 2]))
    turn = np.arctan2(np.abs(d[:, 1]), np.abs(d[:, 0])) * (2.0 / np.pi)
    x, y = r * (1.0 - turn), r * turn
    below = d[:, 2] < 0.0
    x, y = np.where(below, 1.0 - y, x), np.where(below, 1.0 - x, y)
    return (np.column_stack([np.copysign(x, d[:, 0]), np.copysign(y, d[:, 1])]) + 1.0) / 2.0


def test_environment_map(tmp_path):
    """The map that is written has, where pbrt looks, our radiance."""
    theta = np.linspace(0.0, np.pi, 65)[:, None]
    phi = (np.arange(128) + 0.5)[None] * (2.0 * np.pi / 128)
    x, y, z = np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi, -np.sin(theta) * np.cos(phi)
    np.save(tmp_path / "sky.npy", np.stack([1.0 + 0.9 * x, 1.0 + 0.9 * y, 1.0 + 0.9 * z], axis=-1))
    turn = [{"rotate": {"axis": [1, 2, 0], "degrees": 40}}]
    light = {"type": "environment_map", "file": "sky.npy", "scale": 2.0, "transform": turn}
    scene = scene_of(tmp_path, lights=[light])
    ((plugin, params),) = written(scene, tmp_path).lights
    assert plugin == "infinite"
    channels = OpenEXR.File(str(tmp_path / params["string filename"][0]), separate_channels=True)
    texels = np.stack([channels.channels()[name].pixels for name in "RGB"], axis=-1)
    d = np.random.default_rng(2).normal(size=(400, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    side = len(texels)
    column, row = np.minimum(side - 1, (square_of(d) * side).astype(int)).T
    table = scene.lights[0].tabulate(tmp_path)
    ours = np.array([environment_map.radiance(table, Vec3(*x)) for x in d])
    # Radiance changes by 1.8 a radian; half a pixel's diagonal is about 1.5 sqrt(4 pi) / side.
    np.testing.assert_allclose(texels[row, column], ours, atol=1.8 * 1.5 * 3.545 / side)


# ---- materials and textures ----------------------------------------------------------------------

GOLD = {"eta": [0.14, 0.37, 1.44], "k": [3.98, 2.39, 1.6]}

EXPECTED = {
    "matte": (
        {"type": "diffuse", "reflectance": [0.1, 0.2, 0.3]},
        {"string type": ["diffuse"], "rgb reflectance": [0.1, 0.2, 0.3]},
    ),
    "both": (
        {"type": "two_sided", "base": "matte"},
        {"string type": ["diffuse"], "rgb reflectance": [0.1, 0.2, 0.3]},
    ),
    "mirror": (
        {"type": "mirror"},
        {"string type": ["conductor"], "rgb eta": [1.0] * 3, "rgb k": [1e4] * 3},
    ),
    "grey mirror": (
        {"type": "mirror", "reflectance": 0.7},
        {
            "string type": ["mix"],
            "string materials": ["black", "mirror whole"],
            "float amount": [0.7],
        },
    ),
    "gold": (
        {"type": "conductor", **GOLD},
        {"string type": ["conductor"], "rgb eta": GOLD["eta"], "rgb k": GOLD["k"]},
    ),
    "brushed": (
        {"type": "rough_conductor", **GOLD, "alpha": [0.1, 0.3]},
        {
            "string type": ["conductor"],
            "rgb eta": GOLD["eta"],
            "rgb k": GOLD["k"],
            "float uroughness": [0.1],
            "float vroughness": [0.3],
            "bool remaproughness": [False],
        },
    ),
    "water": (
        {"type": "dielectric", "interior_ior": 1.33, "exterior_ior": 1.5},
        {"string type": ["dielectric"], "float eta": [1.33 / 1.5]},
    ),
    "pane": (
        {"type": "thin_dielectric"},
        {"string type": ["thindielectric"], "float eta": [1.5]},
    ),
    "frosted": (
        {"type": "rough_dielectric", "alpha": 0.2},
        {
            "string type": ["dielectric"],
            "float eta": [1.5],
            "float roughness": [0.2],
            "bool remaproughness": [False],
        },
    ),
    "half": (
        {"type": "blend", "first": "matte", "second": "gold", "weight": 0.25},
        {"string type": ["mix"], "string materials": ["matte", "gold"], "float amount": [0.25]},
    ),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_materials(name, tmp_path):
    given = {key: ours for key, (ours, _) in EXPECTED.items()}
    scene = scene_of(shapes=[{"type": "sphere", "material": name}], materials=given)
    file = written(scene, tmp_path)
    assert file.materials[file.shapes[0].material] == EXPECTED[name][1]


def test_a_mirrors_metal_reflects_all():
    """Fresnel's equations for the metal that stands for a mirror (PBR 4ed, 9.3.6)."""
    index = 1.0 + 1e4j
    cosine = np.linspace(0.01, 1.0, 100)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    p = (index * cosine - inside) / (index * cosine + inside)
    s = (cosine - index * inside) / (cosine + index * inside)
    lost = 1.0 - (np.abs(p) ** 2 + np.abs(s) ** 2) / 2.0
    assert np.all(lost <= 4.0 / 1e4**2 / cosine + 1e-15)


def test_black_from_behind_is_noted(tmp_path):
    given = {key: ours for key, (ours, _) in EXPECTED.items()}
    shapes = [{"type": "sphere", "material": name} for name in ("both", "gold", "water")]
    _, notes = write_pbrt(scene_of(shapes=shapes, materials=given), tmp_path / "out.pbrt")
    assert notes == ["black from behind, and not so in pbrt: 'gold'"]
    assert f"# Note: {notes[0]}." in (tmp_path / "out.pbrt").read_text()


UV = {"scale": [1.5, -2.0], "offset": [0.1, 0.35]}


def looked_up(file, name: str, folder: Path, uv: np.ndarray) -> np.ndarray:
    """A texture of pbrt's at (u, v), without filtering."""
    plugin, params = file.textures[name]
    scale, delta = (
        np.array([params[f"float {axis}{what}"][0] for axis in "uv"]) for what in ("scale", "delta")
    )
    s = uv * scale + delta
    if plugin == "checkerboard":
        even = np.floor(s).astype(int).sum(axis=1) % 2 == 0
        key = "rgb" if "rgb tex1" in params else "float"
        first, second = (np.broadcast_to(params[f"{key} tex{k}"], 3) for k in (1, 2))
        return np.where(even[:, None], first, second)
    path = folder / params["string filename"][0]
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    texels = np.stack([channels[name].pixels for name in "RGB"], axis=-1)
    size = np.array(texels.shape[1::-1])
    at = np.column_stack([s[:, 0], 1.0 - s[:, 1]]) * size - 0.5
    assert params["string filter"] == ["bilinear"]
    low = np.floor(at).astype(int)
    part = at - low
    total = np.zeros((len(uv), 3))
    for dx in (0, 1):
        for dy in (0, 1):
            corner = low + np.array([dx, dy])
            if params["string wrap"] == ["repeat"]:
                corner %= size
            else:
                assert params["string wrap"] == ["clamp"]
                corner = np.clip(corner, 0, size - 1)
            weight = np.prod(np.where([dx, dy], part, 1.0 - part), axis=1, keepdims=True)
            total += weight * texels[corner[:, 1], corner[:, 0]]
    return total


@pytest.mark.parametrize(
    "texture",
    [
        {"type": "checker", "first": [0.9, 0.1, 0.2], "second": [0.1, 0.3, 0.8], "uv": UV},
        {"type": "bitmap", "file": "picture.npy", "uv": UV},
        {"type": "bitmap", "file": "picture.npy", "wrap": "clamp", "scale": 0.5, "uv": UV},
    ],
    ids=["checker", "repeat", "clamp"],
)
def test_textures_are_ours(texture, tmp_path):
    """The colours of a rectangle that fills the view, and as a number their luminance."""
    np.save(tmp_path / "picture.npy", np.random.default_rng(4).uniform(size=(5, 7, 3)))
    n = 24
    materials = {
        "paper": {"type": "diffuse", "reflectance": "it"},
        "mixed": {"type": "blend", "first": "paper", "second": "paper", "weight": "it"},
    }
    parts = {
        "textures": {"it": texture},
        "materials": materials,
        "shapes": [{"type": "rectangle", "material": "mixed"}],
        "camera": {"type": "orthographic", "eye": [0, 0, 1], "target": [0, 0, 0], "up": [0, 1, 0]},
        "film": {"width": n, "height": n},
    }
    show = {"integrator": {"type": "ray_cast", "show": "colour"}}
    plain = {"shapes": [{"type": "rectangle", "material": "paper"}]}
    ours = rt.render(scene_of(tmp_path, **{**parts, **show, **plain})).colour.reshape(-1, 3)
    y, x = np.mgrid[:n, :n].reshape(2, -1)
    uv = np.column_stack([x + 0.5, n - y - 0.5]) / n
    file = written(scene_of(tmp_path, **parts), tmp_path)
    mixed = file.materials[file.shapes[0].material]
    paper = file.materials[mixed["string materials"][0]]
    off = 2.0**-23  # the image is written in float32
    colour = looked_up(file, paper["texture reflectance"][0], tmp_path, uv)
    np.testing.assert_allclose(colour, ours, atol=off)
    number = looked_up(file, mixed["texture amount"][0], tmp_path, uv)
    luminance = ours @ [0.2126, 0.7152, 0.0722]
    # Our weights of luminance have more digits.
    np.testing.assert_allclose(number.mean(axis=1), luminance, atol=1e-4)


# ---- the command, and what is refused ------------------------------------------------------------


def test_command(tmp_path):
    found = invoke("convert", SCENES / "cornell_box.yaml", "-o", tmp_path / "a.pbrt")
    assert found.exit_code == 0, found.output
    file = pbrt_reader.read(tmp_path / "a.pbrt")
    assert sum(shape.light is not None for shape in file.shapes) == 1


def test_the_files_of_a_former_scene_do_not_outlive_it(tmp_path):
    np.save(tmp_path / "a.npy", np.ones((2, 2, 3)))
    papered = scene_of(
        tmp_path,
        shapes=[{"type": "sphere", "material": "paper"}],
        materials={"paper": {"type": "diffuse", "reflectance": "a"}},
        textures={"a": {"type": "bitmap", "file": "a.npy"}},
    )
    for scene, count in ((papered, 1), (scene_of(), 0), (papered, 1)):
        assert write_pbrt(scene, tmp_path / "out.pbrt")[0] == count
        assert len([*tmp_path.glob("out_files/*")]) == count


REFUSED = {
    "camera": {"camera": {"type": "perspective", "near": 0.1}},
    "integrator": {"integrator": {"type": "whitted"}},
    "lights[1]": {
        "lights": [
            {"type": "constant", "radiance": 1},
            {"type": "spot", "origin": [0, 0, 0], "target": [0, 0, 1], "intensity": 1},
        ]
    },
    "shapes[0]": {"shapes": [{"type": "plane"}]},
    "materials.foam": {
        "shapes": [{"type": "sphere", "material": "foam"}],
        "materials": {"foam": {"type": "plastic"}},
    },
    "materials.tinted": {
        "shapes": [{"type": "sphere", "material": "tinted"}],
        "materials": {"tinted": {"type": "dielectric", "transmittance": [1, 0.5, 1]}},
    },
    "textures.turned": {
        "shapes": [{"type": "sphere", "material": "paper"}],
        "materials": {"paper": {"type": "diffuse", "reflectance": "turned"}},
        "textures": {"turned": {"type": "checker", "uv": {"rotate": 30}}},
    },
    "textures.mirrored": {
        "shapes": [{"type": "sphere", "material": "wall"}],
        "materials": {"wall": {"type": "diffuse", "reflectance": "mirrored"}},
        "textures": {"mirrored": {"type": "bitmap", "file": "a.png", "wrap": "mirror"}},
    },
}


def test_all_reasons_are_listed_and_nothing_is_written(tmp_path):
    whole: dict = {"shapes": [], "materials": {}, "textures": {}, "lights": []}
    for parts in REFUSED.values():
        for key, value in parts.items():
            if isinstance(value, dict) and key in whole:
                whole[key] |= value
            elif isinstance(value, list):
                whole[key] += value
            else:
                whole[key] = value
    whole["shapes"] = sorted(whole["shapes"], key=lambda shape: shape["type"] != "plane")
    path = tmp_path / "out.pbrt"
    path.write_text("before")
    with pytest.raises(SceneError) as caught:
        write_pbrt(scene_of(**whole), path)
    said = [str(error) for error in (caught.value, *caught.value.others)]
    assert sorted(text.split(": ")[0] for text in said) == sorted(REFUSED)
    assert path.read_text() == "before"
    assert [file.name for file in tmp_path.iterdir()] == ["out.pbrt"]
