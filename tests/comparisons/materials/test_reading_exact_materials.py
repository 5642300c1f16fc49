"""Materials of a user's file that Mitsuba has wrong: replaced where they stand, with the file's own
parameters."""

from pathlib import Path

import numpy as np
import pytest
from mitsuba_dicts import theirs_along
from PIL import Image

from comparisons.mitsuba.backend import backend
from comparisons.translator import reference
from comparisons.translator.reading import read_file
from comparisons.translator.reference import changes_to, own_scene
from reference_rt.rendering.scene import Scene

SCENE = """<scene version="3.0.0">
  <integrator type="path"/>
  <sensor type="perspective"><transform name="to_world">
    <lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
  <shape type="sphere">{}</shape>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="70"/>
    <rotate y="1" angle="-40"/>
    <translate x="2" y="2"/></transform><emitter type="area"/></shape>
  <emitter type="constant"><float name="radiance" value="0.8"/></emitter>
</scene>
"""

WHITE = '<bsdf type="diffuse"><float name="reflectance" value="0.9"/></bsdf>'
MIRROR = '<bsdf type="conductor"><string name="material" value="none"/></bsdf>'
IMAGE = '<string name="filename" value="image.png"/>'
HIGH = '<float name="int_ior" value="3"/><string name="ext_ior" value="vacuum"/>'


def of(plugin: str, *parts: str) -> str:
    return f'<bsdf type="{plugin}">{"".join(parts)}</bsdf>'


def number(name: str, value: float) -> str:
    return f'<float name="{name}" value="{value}"/>'


def texture(name: str) -> str:
    return f'<texture type="bitmap" name="{name}">{IMAGE}</texture>'


BECKMANN = '<string name="distribution" value="beckmann"/>'
GGX = '<string name="distribution" value="ggx"/>'
NONLINEAR = '<boolean name="nonlinear" value="true"/>'
REFLECTANCE = '<rgb name="diffuse_reflectance" value="0.9, 0.6, 0.3"/>'

BRUSHED = of("roughconductor", GGX, number("alpha_u", 0.5), number("alpha_v", 0.1))


def bump_texture(steps: str = "") -> str:
    raw = '<boolean name="raw" value="true"/>'
    return (
        f'<texture type="bitmap">{IMAGE}{raw}<transform name="to_uv">{steps}</transform></texture>'
    )


ALL_NORMALS = '<boolean name="sample_visible" value="false"/>'
MATERIALS = {
    "mirror first": of("blendbsdf", number("weight", 0.6), MIRROR, WHITE),
    "mirror second": of("blendbsdf", number("weight", 0.6), WHITE, MIRROR),
    "textured weight": of("blendbsdf", texture("weight"), WHITE, MIRROR),
    "plastic": of("plastic"),
    "high plastic": of("plastic", HIGH, REFLECTANCE, NONLINEAR),
    "textured plastic": of("plastic", texture("diffuse_reflectance"), NONLINEAR),
    "rough plastic": of("roughplastic", number("alpha", 0.2), REFLECTANCE),
    "rough plastic of GGX": of("roughplastic", GGX, number("alpha", 0.4), HIGH, NONLINEAR),
    "rough conductor": of("roughconductor", number("alpha", 0.4)),
    "oblong conductor": of(
        "roughconductor", BECKMANN, number("alpha_u", 0.6), number("alpha_v", 0.2)
    ),
    "textured conductor": of("roughconductor", texture("alpha")),
    "visible normals": of("roughconductor", '<boolean name="sample_visible" value="true"/>'),
    "visible normals of plastic": of(
        "roughplastic", '<boolean name="sample_visible" value="true"/>', number("int_ior", 2)
    ),
    "rough glass": of("roughdielectric", number("alpha", 0.3)),
    "rough glass by all normals": of("roughdielectric", number("alpha", 0.4), ALL_NORMALS),
    "rough glass of GGX by all normals": of(
        "roughdielectric", GGX, number("alpha", 0.4), ALL_NORMALS
    ),
    "conductor by all normals": of("roughconductor", number("alpha", 0.4), ALL_NORMALS),
    "two-sided": of("twosided", of("roughplastic", number("alpha", 0.3), REFLECTANCE)),
    "bump over brushed metal": of("bumpmap", bump_texture(), BRUSHED, number("scale", 0.4)),
    "bump by a rotated image": of("bumpmap", bump_texture("<rotate z='1' angle='30'/>"), WHITE),
    "plain bump over both": of(
        "bumpmap",
        bump_texture("<scale x='2' y='3'/><rotate z='1' angle='-70'/>"),
        number("scale", 0.2),
        of("blendbsdf", number("weight", 0.3), WHITE, BRUSHED),
        '<boolean name="flip_invalid_normals" value="false"/>',
        '<boolean name="use_shadowing_function" value="false"/>',
    ),
    "blend of plastics": of("blendbsdf", number("weight", 0.4), of("plastic"), of("roughplastic")),
}

FAR_OFF = (
    "mirror first", "mirror second", "textured weight", "high plastic", "rough plastic",
    "bump over brushed metal", "bump by a rotated image",
)  # fmt: skip
"""Where Mitsuba's own is off by more than can be overlooked."""

RAYS, SAMPLES = 64, 4096

FAST = pytest.mark.skipif(
    backend().variant.startswith("scalar"), reason="needs a fast variant of Mitsuba"
)


def scene_of(folder: Path, material: str) -> Scene:
    image = np.random.default_rng(1).integers(60, 255, (4, 8, 3), dtype=np.uint8)
    Image.fromarray(image).save(folder / "image.png")
    (folder / "own.xml").write_text(SCENE.format(MATERIALS[material]))
    return read_file(folder / "own.xml", Scene)


def difference(scene: Scene) -> tuple[float, float]:
    """The relative difference of our mean radiance of the sphere and Mitsuba's, and its standard
    error, in the channel where it is largest."""
    rng = np.random.default_rng(2)
    o = np.tile([0.0, 1.0, 5.0], (RAYS, 1))
    d = rng.uniform(-0.6, 0.6, (RAYS, 3)) - o
    d /= np.linalg.norm(d, axis=1)[:, None]
    ours = scene.radiance(o, d, spp=SAMPLES)
    theirs, error = theirs_along(own_scene(scene), o, d, SAMPLES)
    off = ours.mean.mean(axis=0) / theirs.mean(axis=0) - 1.0
    errors = np.sqrt((ours.standard_error**2 + error**2).mean(axis=0) / RAYS) / theirs.mean(axis=0)
    worst = int(np.argmax(np.abs(off / errors)))
    return float(off[worst]), float(errors[worst])


@pytest.mark.cases(1)
@FAST
@pytest.mark.filterwarnings("ignore::reference_rt.util.errors.SceneWarning")
@pytest.mark.parametrize("material", MATERIALS)
def test_the_exact_material_has_the_files_own_parameters(material: str, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, material)
    assert changes_to(scene)
    off, error = difference(scene)
    # Of 16 materials and 3 channels; 1e-4 for float32.
    assert abs(off) < 4.0 * error + 1e-4
    assert error < 3e-3  # a twelfth of what a blend with a mirror is off


@pytest.mark.cases(2)
@FAST
@pytest.mark.parametrize("material", FAR_OFF)
def test_mitsubas_own_differs(
    material: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reference, "make_exact", lambda parsed, scene: None)
    off, error = difference(scene_of(tmp_path, material))
    assert abs(off) > 6.0 * error


def test_each_of_several_materials_has_its_note(tmp_path: Path) -> None:
    both = of("twosided", of("plastic"), of("plastic", HIGH))
    (tmp_path / "own.xml").write_text(SCENE.format(both))
    notes = changes_to(read_file(tmp_path / "own.xml", Scene))
    assert len(notes) == len(set(notes)) == 2


def test_what_mitsuba_has_right_stays(tmp_path: Path) -> None:
    text = of("blendbsdf", number("weight", 0.6), WHITE, of("roughconductor", GGX))
    (tmp_path / "own.xml").write_text(SCENE.format(text))
    scene = read_file(tmp_path / "own.xml", Scene)
    assert changes_to(scene) == []
    assert "MixtureBlend" not in str(own_scene(scene))
