"""Materials and lights in a scene, against their counterparts in Mitsuba."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counterparts import coarse_meshes, faulty_counterpart
from PIL import Image

from comparisons.compare.pictures import whitted as whitted_pictures
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.notes import notes_of
from comparisons.mitsuba.translate import load
from comparisons.mitsuba.translate.textures import TranslationContext
from comparisons.rungs import direct, geometry, whitted
from reference_rt.rendering.scene import Scene

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
def scene(image_folder: Path) -> Scene:
    return Scene.parse(SCENE, folder=image_folder)


@pytest.fixture(scope="module", autouse=True)
def coarse() -> Any:
    with coarse_meshes(256, 128):
        yield


def test_the_same_light(scene: Scene, tables: Any, counterpart: Any) -> None:
    for result in (
        geometry(scene, tables, counterpart, pixels=1000),
        direct(scene, tables, counterpart, 500),
        whitted(scene, tables, counterpart, 1000),
    ):
        # In a torus that is a mesh, edges are a little wider.
        assert result.status in ("agree", "reference-limited"), result.reason
        assert result.numbers["unexplained" if result.name != "geometry" else "decided_ours"] == 0


@pytest.mark.slow
def test_the_same_picture(scene: Scene, tables: Any, counterpart: Any) -> None:
    images = whitted_pictures(scene, tables, counterpart).images
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
    rung: Any, right: str, wrong: str, scene: Scene, tables: Any, image_folder: Path
) -> None:
    faulty = faulty_counterpart(SCENE, right, wrong, image_folder)
    assert rung(scene, tables, faulty, 500).status == "differ"


def test_notes_report_what_is_not_mitsubas(scene: Scene) -> None:
    notes = " ".join(notes_of(scene))
    for told in ("of a coat's", "no Phong", "blend is wrong", "masks as opaque", "normal maps"):
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


BUMPS = """
camera: {type: perspective, eye: [0.4, 0.5, 4], target: [0, 0, 0], fov: 40}
film: {width: 24, height: 16}
textures: {w: {type: bitmap, file: FILE, encoding: raw, uv: UV}}
materials:
  b: {type: bump, base: m, height: w, scale: 0.05, OPTIONS}
  m: {type: rough_conductor, eta: 1, k: 2, alpha: ALPHA}
shapes:
  - {type: sphere, material: b}
  - {type: rectangle, material: b,
     transform: [{rotate: {axis: [1, 2, 0], degrees: 30}}, {translate: [1, 1, 0]}]}
lights:
  - {type: point, position: [2, 3, 5], intensity: 9}
"""


@pytest.mark.parametrize(
    "options", ["", "flip_invalid_normals: true, use_shadowing_function: true"]
)
@pytest.mark.parametrize(
    ("image", "uv", "alpha"),
    [
        ("heights.png", "{scale: 3}", "[0.15, 0.5]"),
        ("wide.png", "{scale: [3, 2], rotate: 30, offset: [0.1, 0.2]}", "0.4"),
        ("wide.png", "{scale: [3, 2], rotate: -50}", "[0.5, 0.2]"),
    ],
)
def test_bumps_that_mitsuba_gets_wrong(
    image: str, uv: str, alpha: str, options: str, image_folder: Path
) -> None:
    """Over a grain, and by a rotated image that is not square: with our plugin they agree, with
    Mitsuba's own they differ."""
    text = BUMPS.replace("FILE", image).replace("UV", uv).replace("ALPHA", alpha)
    scene = Scene.parse(text.replace("OPTIONS", options), folder=image_folder)
    rung = direct(scene, scene.tables, load(scene), 300)
    assert rung.status == "agree", rung.reason
    assert "our plugin" in " ".join(notes_of(scene))


def with_mitsubas_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Translate materials to Mitsuba's own, as for a file."""
    of = TranslationContext.of
    monkeypatch.setattr(TranslationContext, "of", lambda scene, _=False: of(scene, True))


FLAT = """
camera: {type: perspective, eye: [4, 0.5, 1], target: [0, 0, 0], fov: 40}
film: {width: 24, height: 16}
textures: {w: {type: bitmap, file: flat.png, encoding: raw}}
materials:
  b: {type: bump, base: m, height: w}
  m: {type: rough_conductor, eta: 1, k: 2, alpha: 0.3}
shapes: [{type: rectangle, material: b, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}]}]
lights: [{type: point, position: [5, 3, 2], intensity: 9}]
"""


def test_flat_bumps_with_u_along_the_z_axis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whose tangent is 0 / 0 in Mitsuba's own: black, or not a number."""
    Image.new("L", (4, 4), 128).save(tmp_path / "flat.png")
    scene = Scene.parse(FLAT, folder=tmp_path)
    rung = direct(scene, scene.tables, load(scene), 300)
    assert rung.status == "agree", rung.reason
    with_mitsubas_own(monkeypatch)
    own = direct(scene, scene.tables, load(scene), 300)
    assert own.status == "differ"
    assert "Mitsuba's [0. 0. 0.]" in own.reason


def test_mitsubas_own_bumps_are_wrong_there(
    image_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_mitsubas_own(monkeypatch)
    for image, uv, alpha in (
        ("heights.png", "{scale: 3}", "[0.15, 0.5]"),
        ("wide.png", "{scale: [3, 2], rotate: 30}", "0.4"),
    ):
        text = BUMPS.replace("FILE", image).replace("UV", uv).replace("ALPHA", alpha)
        scene = Scene.parse(text.replace("OPTIONS", ""), folder=image_folder)
        assert direct(scene, scene.tables, load(scene), 300).status == "differ"
