"""Textures, wrapped materials and lights against their twins: each alone, then in a scene."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from comparisons.mitsuba_backend import mitsuba
from comparisons.mitsuba_scene import for_rays
from comparisons.pictures import whitted as whitted_pictures
from comparisons.tiers import direct, film, geometry, whitted
from comparisons.translate import UntranslatableError, load, to_mitsuba
from comparisons.translate.lights import translate_light
from comparisons.translate.notes import notes_of
from comparisons.translate.shapes import tori
from comparisons.translate.textures import Surroundings, translate_texture
from reference_rt.filters import (
    AnyFilter,
    CatmullRomFilter,
    GaussianFilter,
    LanczosFilter,
    MitchellFilter,
    TentFilter,
)
from reference_rt.lights import EnvironmentMap, environment_map
from reference_rt.scene import Scene
from reference_rt.tables import build_tables
from reference_rt.textures import At, Bitmap, Checker, Texture, VertexColours
from reference_rt.textures.lookup import lookup, lookup_gradient
from reference_rt.textures.texture import UvMap
from reference_rt.vec3 import Vec3, luminance

TURNED = UvMap(scale=(1.3, 0.7), rotate=25.0, offset=(0.1, -0.2))

TEXTURES: tuple[Texture, ...] = (
    Checker(first=(0.1, 0.2, 0.3), second=(0.9, 0.7, 0.4), uv=TURNED),
    Checker(first=(1.0, 2.0, 3.0), second=(9.0, 7.0, 4.0), uv=TURNED),
    *(
        Bitmap(file="colours.png", filter=filter_type, wrap=wrap, uv=TURNED)
        for filter_type in ("bilinear", "nearest")
        for wrap in ("repeat", "clamp", "mirror")
    ),
    Bitmap(file="colours.png", encoding="raw"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("images")
    rng = np.random.default_rng(3)

    def write(name: str, values: Any, size: tuple[int, int]) -> None:
        image = Image.fromarray((255.0 * values).astype(np.uint8)).resize(size, Image.BICUBIC)
        image.save(path / name)

    write("colours.png", rng.uniform(size=(4, 6, 3)), (24, 16))
    write("heights.png", rng.uniform(size=(6, 6)), (32, 32))
    write("wide.png", rng.uniform(size=(6, 6)), (32, 16))
    write("sky.png", rng.uniform(size=(8, 16, 3)) ** 3, (32, 16))
    tilt = 0.1 * np.sin(np.linspace(0.0, 9.0, 32))
    write(
        "normals.png",
        np.dstack([*np.meshgrid(0.5 + tilt, 0.5 + tilt), np.full((32, 32), 0.95)]),
        (32, 32),
    )
    return path


def interaction(u: Any, v: Any) -> Any:
    import drjit as dr

    mi = mitsuba()
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.t, si.uv = 1.0, mi.Point2f(u, v)
    return si


@pytest.mark.parametrize("texture", TEXTURES)
def test_textures(texture: Texture, folder: Path) -> None:
    scene = Scene(textures={"t": texture})
    scene._folder = folder
    textures = build_tables(scene).textures
    around = Surroundings.of(scene)
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-2.0, 2.0, (2, 500)).astype(np.float32).astype(np.float64)
    at = [
        At(textures, a, b, Vec3(-1.0, -1.0, -1.0))
        for a, b in zip(u.tolist(), v.tolist(), strict=True)
    ]
    ours = np.array([tuple(lookup(0, a)) for a in at])
    load_dict = mitsuba().load_dict
    colours = load_dict(translate_texture(texture, "t", around, False))
    numbers = load_dict(translate_texture(texture, "t", around, True))
    theirs = for_rays(lambda a, b: (colours.eval(interaction(a, b)),), u, v)[0]
    one = for_rays(lambda a, b: (numbers.eval_1(interaction(a, b)),), u, v)[0]
    # uv round by 2^-23 each; from one texel to the next is a step of 1 at most, over 1/24.  An
    # edge may lie in between: none does for this seed.
    bound = 24.0 * 8.0 * 2.0**-23 * max(1.0, float(ours.max()))
    np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=bound)
    grey = np.array([luminance(Vec3(*c)) for c in ours])
    np.testing.assert_allclose(one, grey, rtol=0.0, atol=bound)
    if isinstance(texture, Bitmap) and texture.filter == "bilinear" and texture.uv == UvMap():
        gradient = for_rays(lambda a, b: (numbers.eval_1_grad(interaction(a, b)),), u, v)[0]
        slopes = np.array([lookup_gradient(0, a) for a in at])
        np.testing.assert_allclose(gradient, slopes, rtol=0.0, atol=24.0 * bound)


def test_vertex_colours_where_there_are_none() -> None:
    texture = VertexColours(without=(0.1, 0.2, 0.3))
    around = Surroundings({}, {"t": texture}, Path())
    assert translate_texture(texture, "t", around, False)["value"] == [0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    "turn", ["[]", "[{rotate: {axis: [0.3, 1, 0.1], degrees: 37}}]", "[{scale: [-1, 1, 1]}]"]
)
def test_environment_maps(turn: str, folder: Path) -> None:
    scene = Scene.parse(
        f"lights: [{{type: environment_map, file: sky.png, scale: 2.5, transform: {turn}}}]",
        folder=folder,
    )
    light = scene.lights[0]
    assert isinstance(light, EnvironmentMap)
    table = light.tabulate(folder)
    rng = np.random.default_rng(2)
    d = rng.normal(size=(500, 3))
    d = (d / np.linalg.norm(d, axis=1)[:, None]).astype(np.float32).astype(np.float64)
    ours = np.array([tuple(environment_map.radiance(table, Vec3(*row))) for row in d.tolist()])
    emitter = mitsuba().load_dict(translate_light(light, Surroundings.of(scene)))

    def radiance(towards: Any) -> tuple[Any, ...]:
        si = interaction(0.0, 0.0)
        si.wi = -towards
        return (emitter.eval(si),)

    theirs = for_rays(radiance, d)[0]
    # A direction's 4 roundings, over a texel of 2 pi / 32, near the poles over its sine.
    sine = np.hypot(d[:, 0], d[:, 2])
    bound = 32.0 * 8.0 * 2.0**-24 * table.texels.max() / np.maximum(sine, 0.05)
    assert (np.abs(theirs - ours).max(axis=1) < bound).all()


FILTERS: tuple[AnyFilter, ...] = (
    TentFilter(radius=1.5),
    GaussianFilter(),
    GaussianFilter(stddev=0.8),
    MitchellFilter(),
    MitchellFilter(b=0.1, c=0.9),
    CatmullRomFilter(),
    LanczosFilter(),
    LanczosFilter(lobes=5),
)


@pytest.mark.parametrize("film_filter", FILTERS)
def test_filters(film_filter: AnyFilter) -> None:
    tier = film(film_filter, film_filter)
    assert (tier.name, tier.status) == ("film", "agree"), tier.reason


def test_another_filter_is_told_apart() -> None:
    third = 1.0 / 3.0
    reference = MitchellFilter(b=third, c=third)
    assert film(reference, reference).status == "agree"
    assert film(MitchellFilter(b=0.3334, c=third), reference).status == "differ"


SCENE = """
camera: {type: perspective, eye: [0, 5, 8], target: [0, 0, 0], fov: 40}
film: {width: 48, height: 32}
integrator: {type: whitted, max_depth: 3}
textures:
  im: {type: bitmap, file: colours.png, uv: {scale: [3, 2], rotate: 20, offset: [0.1, 0.2]}}
  tiles: {type: checker, first: [0.8, 0.7, 0.1], second: [0.1, 0.2, 0.6], uv: {scale: [8, 4]}}
  bright: {type: checker, first: [3, 2, 1], second: [1, 5, 6], uv: {scale: 2, offset: [0.13, 0.27]}}
  h: {type: bitmap, file: heights.png, encoding: raw, uv: {scale: 2}}
  n: {type: bitmap, file: normals.png, encoding: raw}
materials:
  floor: {type: diffuse, reflectance: tiles}
  lamp: {type: emissive, radiance: bright, base: floor}
  glow: {type: emissive, radiance: [1, 2, 3]}
  mirror: {type: mirror, reflectance: im}
  pane: {type: thin_dielectric, transmittance: [0.9, 0.8, 0.7]}
  rough: {type: rough_conductor, eta: [0.2, 0.9, 1.1], k: [3, 2, 2.5], alpha: im}
  plastic: {type: plastic, reflectance: im}
  pr: {type: principled, base_colour: im, roughness: h, metallic: tiles}
  ph: {type: phong, ambient: im, diffuse: im, specular: 0.3, exponent: 40, mirror: [0.1, 0.2, 0.1]}
  mask: {type: mask, base: plastic, opacity: h}
  two: {type: two_sided, base: plastic, back: ph}
  blend: {type: blend, first: mirror, second: ph, weight: h}
  bump: {type: bump, base: rough, height: h, scale: 0.05}
  nm: {type: normal_map, base: two, normals: n}
shapes:
  - {type: rectangle, material: floor,
     transform: [{scale: 6}, {rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, -1, 0]}]}
  - {type: rectangle, material: lamp,
     transform: [{scale: [0.6, 0.4, 1]}, {rotate: {axis: [1, 0, 0], degrees: 80}},
       {translate: [0, 5, -2]}]}
  - {type: torus, material: glow, major_radius: 0.3, minor_radius: 0.1,
     transform: [{translate: [3, 1, -3]}]}
  - {type: sphere, material: pane, radius: 0.6, center: [-2.4, 0, -1.5]}
  - {type: box, material: pr,
     transform: [{scale: 0.4}, {rotate: {axis: [1, 0.3, 0.2], degrees: -50}},
       {translate: [-0.8, 0, -1.5]}]}
  - {type: sphere, material: mask, radius: 0.6, center: [0.8, 0, -1.5]}
  - {type: sphere, material: blend, radius: 0.6, center: [2.4, 0, -1.5]}
  - {type: sphere, material: bump, radius: 0.6, center: [-2.4, 0, 1]}
  - {type: sphere, material: nm, radius: 0.6, center: [-0.8, 0, 1]}
  - {type: rectangle, material: nm,
     transform: [{scale: 0.6}, {rotate: {axis: [1, 0, 0.2], degrees: 110}},
       {translate: [0.8, 0, 1]}]}
lights:
  - {type: point, position: [3, 4, 4], intensity: [10, 11, 12]}
  - {type: spot, origin: [-4, 6, 3], target: [0, 0, 0], intensity: [60, 50, 40], cutoff_angle: 25}
  - {type: directional, direction: [0.2, -1, -0.4], irradiance: [0.5, 0.6, 0.7]}
  - {type: environment_map, file: sky.png, scale: 0.5,
     transform: [{rotate: {axis: [0.3, 1, 0.1], degrees: 37}}]}
  - {type: ambient, radiance: [0.3, 0.2, 0.4]}
"""


@pytest.fixture(scope="module")
def scene(folder: Path) -> Scene:
    return Scene.parse(SCENE, folder=folder)


@pytest.fixture(scope="module")
def tables(scene: Scene) -> Any:
    return build_tables(scene)


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mesh for the torus that takes less time to make."""
    monkeypatch.setattr(tori, "CELLS", (256, 128))


@pytest.fixture(scope="module")
def twin(scene: Scene) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tori, "CELLS", (256, 128))
        return load(scene)


def test_the_same_light(scene: Scene, tables: Any, twin: Any) -> None:
    for tier in (
        geometry(scene, tables, twin, pixels=1000),
        direct(scene, tables, twin, 500),
        whitted(scene, tables, twin, 1000),
    ):
        # In a torus that is a mesh, edges are a little wider.
        assert tier.status in ("agree", "reference-limited"), tier.reason
        assert tier.numbers["unexplained" if tier.name != "geometry" else "decided_ours"] == 0


@pytest.mark.slow
def test_the_same_picture(scene: Scene, tables: Any, twin: Any) -> None:
    images = whitted_pictures(scene, tables, twin).images
    off = np.abs(images.candidate - images.reference).max(axis=-1)
    assert (off > 1e-3).mean() < 0.01  # edges within float32


FAULTS: tuple[tuple[Any, str, str], ...] = (
    (direct, "first: [0.8, 0.7, 0.1]", "first: [0.8, 0.7, 0.11]"),
    (direct, "cutoff_angle: 25", "cutoff_angle: 25.2"),
    (direct, "scale: 0.05}", "scale: 0.051}"),
    (whitted, "ambient: im", "ambient: tiles"),
)
MORE_FAULTS: tuple[tuple[Any, str, str], ...] = (
    (direct, "uv: {scale: [8, 4]}", "uv: {scale: [8, 4], offset: [0.5, 0]}"),
    (direct, "rotate: 20, offset", "rotate: 21, offset"),
    (direct, "uv: {scale: 2, offset: [0.13, 0.27]}", "uv: {scale: 2, offset: [0.63, 0.27]}"),
    (direct, "direction: [0.2, -1, -0.4]", "direction: [0.2, -1, -0.41]"),
    (direct, "degrees: 37", "degrees: 38"),
    (direct, "exponent: 40", "exponent: 41"),
    (whitted, "second: ph, weight", "second: plastic, weight"),
    (whitted, "opacity: h", "opacity: 0.5"),
    (whitted, "mirror: [0.1, 0.2, 0.1]", "mirror: [0.1, 0.2, 0.11]"),
)


@pytest.mark.parametrize(
    ("rung", "right", "wrong"),
    [*FAULTS, *(pytest.param(*fault, marks=pytest.mark.slow) for fault in MORE_FAULTS)],
)
def test_a_planted_fault_is_seen(
    rung: Any, right: str, wrong: str, scene: Scene, tables: Any, folder: Path
) -> None:
    assert SCENE.count(right) == 1
    faulty = load(Scene.parse(SCENE.replace(right, wrong), folder=folder))
    assert rung(scene, tables, faulty, 500).status == "differ"


def test_notes_tell_what_is_not_mitsubas(scene: Scene) -> None:
    notes = " ".join(notes_of(scene))
    for told in ("coat mirrors", "no Phong", "blend is wrong", "masks for opaque", "normal maps"):
        assert told in notes


@pytest.mark.parametrize("first", ["mirror", "conductor", "thin_dielectric"])
def test_blends_with_mirrors_keep_their_light(first: str) -> None:
    """Half of what keeps all light over half of what keeps a half, under an even sky; Mitsuba's own
    blend loses a twelfth of it."""
    bsdfs = {"mirror": {"type": "conductor"}, "conductor": {"type": "conductor"}}
    bsdf = {
        "type": "mixture_blend",
        "weight": 0.5,
        "first": bsdfs.get(first, {"type": "thindielectric"}),
        "second": {"type": "diffuse", "reflectance": 0.5},
    }
    mi = mitsuba()
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},
            "sensor": {
                "type": "perspective",
                "fov": 5,
                "to_world": mi.ScalarTransform4f().look_at([0, 1, 5], [0, 0, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 4, "height": 4, "pixel_format": "rgb"},
            },
            "sky": {"type": "constant", "radiance": 1.0},
            "wall": {"type": "rectangle", "bsdf": bsdf},
        }
    )
    picture = np.array(mi.render(scene, spp=4000))
    # A path brings 1 or 1/2: at most a half of standard deviation, over 64,000 of them.
    assert picture.mean() == pytest.approx(0.75, abs=5.0 * 0.5 / np.sqrt(64_000.0))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "materials: {b: {type: bump, base: m, height: w}, m: {type: diffuse}}\n"
            "textures: {w: {type: bitmap, file: wide.png, uv: {rotate: 30}}}\n"
            "shapes: [{type: sphere, material: b}]",
            "not square",
        ),
        (
            "materials: {b: {type: bump, base: m, height: w},"
            " m: {type: rough_conductor, eta: 1, k: 2, alpha: [0.1, 0.2]}}\n"
            "textures: {w: {type: bitmap, file: heights.png}}\n"
            "shapes: [{type: sphere, material: b}]",
            "grain",
        ),
        (
            "materials: {m: {type: diffuse, reflectance: c}}\n"
            "textures: {c: {type: checker}}\n"
            "shapes: [{type: torus, material: m, major_radius: 1, minor_radius: 0.3}]",
            "Torus",
        ),
    ],
)
def test_what_mitsuba_does_otherwise_is_not_compared(text: str, said: str, folder: Path) -> None:
    with pytest.raises(UntranslatableError, match=said):
        to_mitsuba(Scene.parse(text, folder=folder))
