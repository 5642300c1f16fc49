"""Mitsuba scenes as strangers write them: old spellings, plugins for derivatives, degenerate
values, includes without end."""

import re
import warnings
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mitsuba_dicts import both_scenes, deviations, hits_of, rays_at
from mitsuba_rows import bitmap, rgb
from PIL import Image
from test_reading_plugins import fast, filled

from comparisons.mitsuba import included
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.included import PRIMAL
from comparisons.translator.reading import read_file
from comparisons.translator.reference import changes_to, own_scene
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError, SceneWarning

LOOK = '<transform name="to_world"><lookat origin="0,1,5" target="0,0,0" up="0,1,0"/></transform>'
FILM = (
    '<film type="hdrfilm"><integer name="width" value="{}"/><integer name="height" value="{}"/>'
    '<rfilter type="box"/></film>'
)
SENSOR = f'<sensor type="perspective">{LOOK}{FILM.format(4, 4)}</sensor>'
LIGHT = '<emitter type="constant"/>'
BALL = '<shape type="sphere"/>'


def scene_of(tmp_path: Path, content: str, version: str = "3.0.0") -> tuple[Scene, list[str]]:
    """Our reading of a file, and what was said."""
    path = tmp_path / "scene.xml"
    path.write_text(f'<scene version="{version}">{content}</scene>')
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scene = read_file(path, Scene)
    return scene, [str(x.message) for x in said]


def refusal(tmp_path: Path, content: str, version: str = "3.0.0") -> str:
    with pytest.raises(SceneError) as caught:
        scene_of(tmp_path, content, version)
    return str(caught.value)


def test_spellings_of_mitsuba_0(tmp_path):
    old = SENSOR.replace("to_world", "toWorld").replace("lookat", "lookAt")
    inner = '<shape type="sphere"><transform name="toWorld"><lookAt origin="1,0,0" target="1,2,0" '
    inner += 'up="0,0,1"/></transform></shape>'
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "ball.xml").write_text(f'<scene version="0.6.0">{inner}</scene>')
    image = '<texture name="reflectance" type="bitmap"><string name="filename" value="a.png"/>'
    image += '<string name="filterType" value="{}"/></texture>'
    Image.new("RGB", (2, 2)).save(tmp_path / "a.png")
    content = f'{old}<include filename="parts/ball.xml"/>{LIGHT}<shape type="rectangle">'
    for kind in ("trilinear", "ewa"):
        whole = f'{content}<bsdf type="diffuse">{image.format(kind)}</bsdf></shape>'
        scene, said = scene_of(tmp_path, whole, "0.5.0")
        assert all(any(word in x for x in said) for word in ("lookAt", f"'{kind}'"))
    assert (scene.camera.eye, scene.camera.up) == ((0.0, 1.0, 5.0), (0.0, 1.0, 0.0))  # as written
    assert any("lookAt" in x for x in changes_to(scene))
    o, d = rays_at((0.5, 0.0, 0.0), 1.5, 200, seed=3)
    np.testing.assert_allclose(scene.intersect(o, d).t, hits_of(own_scene(scene), o, d)[0], 1e-4)
    # Places in messages are those of the files, not of copies.
    message = refusal(tmp_path, f'{old}\n<shape type="sphere"><oh/></shape>', "0.5.0")
    assert message.startswith(f"{tmp_path / 'scene.xml'}:2: column ")
    (tmp_path / "parts" / "ball.xml").write_text(f'<scene version="0.6.0">\n{inner}<oh/></scene>')
    assert f"{tmp_path / 'parts' / 'ball.xml'}:2: column " in refusal(
        tmp_path, content + "</shape>"
    )


@pytest.mark.parametrize("how", ["beside", "absolute", "through a folder", "link"])
def test_copies_of_old_files_stay_in_their_folder(how, tmp_path):
    """No file of the user's is written to, whatever name includes it."""
    inner = '<shape type="sphere"><transform name="to_world"><lookAt origin="1,0,0" '
    inner += 'target="1,2,0" up="0,0,1"/></transform></shape>'
    for folder in ("scene", "other"):
        (tmp_path / folder).mkdir()
    other = tmp_path / "other" / "ball.xml"
    other.write_text(f'<scene version="0.6.0">{inner}</scene>')
    before = other.read_bytes()
    name = {
        "beside": "../other/ball.xml",
        "absolute": str(other),
        "through a folder": "a/../../other/ball.xml",
        "link": "link.xml",
    }[how]
    (tmp_path / "scene" / "a").mkdir()
    (tmp_path / "scene" / "link.xml").symlink_to(other)
    content = f'{SENSOR}<include filename="{name}"/>{LIGHT}'
    if how == "link":
        scene_of(tmp_path / "scene", content)
    else:
        message = refusal(tmp_path / "scene", content)
        assert f"is included as '{name}'; expected <lookat>" in message
    assert other.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"scene", "other"}


@pytest.mark.parametrize("plugin", PRIMAL)
def test_integrators_for_derivatives(plugin, tmp_path):
    words = f'<integrator type="{plugin}"><integer name="sppi" value="0"/>'
    depth = "" if plugin == "direct_projective" else '<integer name="max_depth" value="{}"/>'
    lamp = '<shape type="rectangle"><emitter type="area"/></shape>'
    for given, ours in (("", 6), ("0", 1), ("1", 1), ("-1", None), ("3", 3)):
        inside = depth.format(given) if given else ""
        scene, said = scene_of(tmp_path, f"{words}{inside}</integrator>{SENSOR}{lamp}{LIGHT}")
        assert any(f"stands for '{plugin}'" in x for x in said)
        if depth:
            assert scene.integrator.max_depth == ours
    # The picture of the plugin itself; depths at which they differ are said.
    if plugin != "prbvolpath" and mitsuba().variant() != "scalar_rgb":
        mi = mitsuba()
        own = own_scene(scene)
        theirs = mi.load_dict({"type": plugin} | ({"max_depth": 3} if depth else {}))
        pictures = [mi.render(own, integrator=x, spp=1024) for x in (theirs, own.integrator())]
        np.testing.assert_allclose(*(np.array(x).mean() for x in pictures), rtol=0.02)


def test_sensors(tmp_path):
    ball = f"{BALL}{LIGHT}"
    for placed in (
        '<point name="origin" x="0.3" y="0" z="4"/><vector name="direction" x="0" y="0" z="-2"/>',
        '<transform name="to_world"><lookat origin="0.3,0,4" target="0.3,0,0" up="0,1,0"/>'
        "</transform>",
    ):
        meter = f'<sensor type="radiancemeter">{placed}{FILM.format(1, 1)}</sensor>'
        scene, _ = scene_of(tmp_path, meter + ball)
        eye, target = (np.array(x) for x in (scene.camera.eye, scene.camera.target))
        np.testing.assert_allclose(eye, [0.3, 0.0, 4.0], atol=1e-9)
        np.testing.assert_allclose(target - eye, [0.0, 0.0, -4.0], atol=1e-9)
        assert scene.camera.width < 1e-9
    for alone in (
        '<point name="origin" value="1, 0, 0"/>',
        '<vector name="direction" value="1, 0, 0"/>',
    ):
        told = refusal(tmp_path, meter.replace(placed, alone) + ball)
        assert "alone; expected 'origin' and 'direction'" in told
    assert "1 x 1" in refusal(tmp_path, meter.replace(FILM.format(1, 1), FILM.format(2, 1)) + ball)
    second = SENSOR.replace("0,1,5", "0,1,9")
    batch = f'<sensor type="batch">{FILM.format(6, 5)}{SENSOR}{second}</sensor>'
    scene, said = scene_of(tmp_path, batch + ball)
    assert scene.camera.eye == (0.0, 1.0, 5.0)
    assert (scene.film.width, scene.film.height) == (3, 5)
    assert any("first of 2 sensors of a batch" in x for x in said)
    assert tuple(own_scene(scene).sensors()[0].film().size()) == (3, 5)
    assert "surface" in refusal(tmp_path, f'<sensor type="irradiancemeter"/>{ball}')
    assert "disk" in refusal(tmp_path, f'<sensor type="distant"/>{ball}')
    assert "has no sensor" in refusal(tmp_path, ball)


def test_merged_shapes(tmp_path):
    inside = '<shape type="cube"/><shape type="rectangle"><transform name="to_world">'
    inside += '<translate x="3"/></transform></shape>'
    scene, said = scene_of(tmp_path, f'{SENSOR}<shape type="merge">{inside}</shape>{LIGHT}')
    assert len(scene.shapes) == 2
    assert "'merge'" in said[0]
    o, d = rays_at((1.0, 0.0, 0.0), 2.0, 200, seed=5)
    np.testing.assert_allclose(scene.intersect(o, d).t, hits_of(own_scene(scene), o, d)[0], 1e-4)


def test_what_a_fork_added_is_left_out(tmp_path):
    path = tmp_path / "scene.xml"
    fork = '<integrator type="of_a_fork"/><shape type="sphere"><float name="fuzz" value="1"/>'
    path.write_text(f'<scene version="3.0.0">{fork}</shape>{SENSOR}{LIGHT}</scene>')
    with (
        pytest.warns(SceneWarning, match="'of_a_fork'"),
        pytest.warns(SceneWarning, match="'fuzz'"),
    ):
        read_file(path, Scene, allow_missing=True)


@pytest.mark.parametrize("plugin", ["roughconductor", "roughdielectric", "roughplastic"])
def test_roughness_of_zero_is_the_least_of_mitsuba(plugin, tmp_path):
    for given in ("0", "1e-5", "0.0001", "0.2"):
        bsdf = f'<bsdf type="{plugin}"><float name="alpha" value="{given}"/></bsdf>'
        scene, said = scene_of(tmp_path, f'{SENSOR}<shape type="sphere">{bsdf}</shape>{LIGHT}')
        (material,) = scene.materials.values()
        assert np.unique(material.alpha).tolist() == [max(float(given), 1e-4)]
        assert any("'alpha'" in x for x in said) == (float(given) < 1e-4)
        light = mitsuba().render(own_scene(scene), spp=16)
        assert np.isfinite(np.array(light)).all()


def test_metals_without_refraction_in_a_channel(tmp_path):
    for kind in ("conductor", "roughconductor"):
        bsdf = f'<bsdf type="{kind}"><string name="material" value="AlSb"/></bsdf>'
        scene, _ = scene_of(tmp_path, f'{SENSOR}<shape type="sphere">{bsdf}</shape>{LIGHT}')
        (material,) = scene.materials.values()
        assert 0.0 < material.eta[0] < 1e-9


def test_checkerboards_of_textures(tmp_path):
    fast()
    rng = np.random.default_rng(8)
    for name in ("a", "b"):
        Image.fromarray(rng.integers(40, 255, (5, 7, 3), np.uint8)).save(tmp_path / f"{name}.png")

    def fields(*names: str, **more: Any) -> dict[str, Any]:
        keyed = zip(("color0", "color1"), names, strict=False)
        images = {key: filled(bitmap(f"{name}.png"), tmp_path) for key, name in keyed}
        to_uv = mitsuba().ScalarTransform3f().scale([3, 2])
        return {"type": "checkerboard", "to_uv": to_uv} | images | more

    both = fields("a", "b")
    for bsdf in (
        {"type": "diffuse", "reflectance": both},
        {"type": "diffuse", "reflectance": fields("a")},
        {"type": "roughconductor", "distribution": "ggx", "alpha": both},  # numbers: exchanged
        {"type": "principled", "base_color": both, "roughness": fields("b", color1=0.3)},
        {"type": "twosided", "in": {"type": "plastic", "diffuse_reflectance": both}},
    ):
        scene = {
            "integrator": {"type": "path", "max_depth": 3},
            "sky": {"type": "constant", "radiance": rgb(0.3, 0.5, 0.4)},
            "shape": {"type": "sphere", "bsdf": bsdf},
        }
        o, d = rays_at((0.0, 0.0, 0.0), 1.0, 64, seed=1)
        assert np.abs(deviations(scene, o, d, 256)).max() < 5.5, bsdf["type"]


QUAD = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"
SHAPES = ("rectangle", "disk", "cube", "sphere", "cylinder", "obj", "instance")


def placed(kind: str, m: Any, tmp_path: Path) -> dict[str, Any]:
    """A scene of one shape under a map."""
    if kind == "instance":
        group = {"type": "shapegroup", "a": {"type": "sphere"}}
        return {
            "g": group,
            "s": {"type": "instance", "to_world": m, "g": {"type": "ref", "id": "g"}},
        }
    (tmp_path / "quad.obj").write_text(QUAD)
    file = {"filename": str(tmp_path / "quad.obj")} if kind == "obj" else {}
    return {"s": {"type": kind, "to_world": m, **file}}


@pytest.mark.parametrize("kind", SHAPES)
def test_shapes_under_odd_maps_are_those_of_mitsuba_or_refused(kind, tmp_path):
    """Maps that flatten, and those that Mitsuba makes of rotation axes of another length than 1."""
    t = mitsuba().ScalarTransform4f
    flat = [t().scale([float(x) for x in s]) for s in product((0, 1.5), repeat=3)]
    turns = [t().rotate(axis, 50) for axis in ([1, 1, 0], [0.577, 0.577, 0.577], [0, 0, 0.9])]
    o, d = rays_at((0.0, 0.0, 0.0), 1.0, 300, seed=2)
    read, refusals = 0, list[str]()
    for inner, turn in product([*flat, *turns], (t(), t().rotate([0, 1, 0], 30).scale(1.2))):
        scene = placed(kind, turn @ inner, tmp_path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                ours, theirs = both_scenes(scene)
            except SceneError as error:
                refusals.append(str(error))
                continue
        read += 1
        hits, (distance, _, ns, _) = ours.intersect(o, d), hits_of(theirs, o, d)
        assert (np.isfinite(hits.t) != np.isfinite(distance)).sum() <= 3
        both = np.isfinite(hits.t) & np.isfinite(distance)
        np.testing.assert_allclose(hits.t[both], distance[both], atol=1e-4)
        np.testing.assert_allclose(hits.ns[both], ns[both], atol=1e-3)
    assert read >= (14 if kind in ("rectangle", "disk") else 3)
    assert all(re.search("flat|unit vector|ellips|oblique", error) for error in refusals)


@pytest.mark.parametrize(
    "kind", ["point", "spot", "directional", "constant", "projector", "envmap"]
)
def test_lights_under_a_scale_are_those_of_mitsuba_or_refused(kind, tmp_path):
    fast()
    image = np.random.default_rng(4).integers(40, 255, (8, 16, 3), np.uint8)
    Image.fromarray(image).save(tmp_path / "sky.png")
    t = mitsuba().ScalarTransform4f
    o, d = rays_at((0.0, 0.0, 0.0), 1.0, 48, seed=1)
    for scale in (0.5, 1.0, 3.0):
        file = {"filename": str(tmp_path / "sky.png")} if kind == "envmap" else {}
        m = t().look_at([2, 3, 4], [0, 0, 0], [0, 1, 0]).scale(scale)
        scene = {
            "integrator": {"type": "path", "max_depth": 2},
            "emitter": {"type": kind, "to_world": m, **file},
            "shape": {"type": "sphere", "bsdf": {"type": "diffuse"}},
        }
        if scale != 1.0 and kind in ("directional", "projector", "envmap"):
            with pytest.raises(SceneError, match=f"scales by {scale:g}"):
                both_scenes(scene)
        else:
            assert np.abs(deviations(scene, o, d, 128)).max() < 5.5


def test_includes_end(tmp_path, monkeypatch):
    def write(name: str, *parts: str, head: str = "") -> None:
        inside = "".join(f'<include filename="{part}"/>' for part in parts)
        (tmp_path / name).write_text(f'<scene version="3.0.0">{head}\n{inside}</scene>')

    write("scene.xml", *["scene.xml"] * 4)
    assert "scene.xml:2: <include> of 'scene.xml' makes a cycle" in refused(tmp_path)
    write("scene.xml", "a.xml")
    write("a.xml", "b.xml")
    write("b.xml", "a.xml")
    assert re.search("b.xml:2: .*a.xml > b.xml > a.xml", refused(tmp_path))
    write("scene.xml", "$next", head='<default name="next" value="scene.xml"/>')
    assert "cycle" in refused(tmp_path)
    (tmp_path / "sub").mkdir()
    write("scene.xml", "c.xml", head='<path value="sub"/>')
    write("sub/c.xml", "scene.xml")
    assert "cycle" in refused(tmp_path)
    write("scene.xml", *["p0.xml"] * 4)  # no cycle, but 4^10 files
    for k in range(10):
        write(f"p{k}.xml", *[f"p{k + 1}.xml"] * 4)
    assert f"more than {included.MOST_FILES} files" in refused(tmp_path)
    write("scene.xml", *["d.xml"] * 3)
    write("d.xml", head="<!--" + 500 * "x" + "-->")
    monkeypatch.setattr(included, "MOST_BYTES", 1500)
    assert "more than" in refused(tmp_path)


def refused(tmp_path: Path, content: bytes | None = None) -> str:
    if content is not None:
        (tmp_path / "scene.xml").write_bytes(content)
    with pytest.raises(SceneError) as caught:
        read_file(tmp_path / "scene.xml", Scene)
    return str(caught.value)


def test_what_is_no_utf8(tmp_path):
    whole = (
        f'<scene version="3.0.0">{SENSOR}<!-- c --><shape type="sphere" id="i"/></scene>'.encode()
    )
    for found in re.finditer(rb"scene|version|sphere|shape|id|\bi\b| c ", whole):
        bad = whole[: found.start()] + b"\xff" + whole[found.start() + 1 :]
        if found[0] == b" c ":
            (tmp_path / "scene.xml").write_bytes(bad)
            read_file(tmp_path / "scene.xml", Scene)
        else:
            assert "no UTF-8" in refused(tmp_path, bad)
    # Latin-1 by declaration, and UTF-16, are read as before.
    for text, encoding in (
        ('<?xml version="1.0" encoding="iso-8859-1"?>' + whole.decode(), "latin-1"),
        (whole.decode(), "utf-16"),
    ):
        (tmp_path / "scene.xml").write_bytes(text.replace('"i"', '"\xe9"').encode(encoding))
        assert len(read_file(tmp_path / "scene.xml", Scene).shapes) == 1


@pytest.mark.parametrize("magic", ["P6", "P6 of 16 bits"])
def test_portable_pixmaps(magic, tmp_path):
    values = np.random.default_rng(2).integers(0, 255, (2, 3, 3))
    if magic == "P6":
        data = b"P6\n3 2\n255\n" + values.astype(np.uint8).tobytes()
    else:
        data = b"P6\n3 2\n65535\n" + (values * 257).astype(">u2").tobytes()
    (tmp_path / "a.ppm").write_bytes(data)
    image = bitmap(str(tmp_path / "a.ppm")) | {"filter_type": "nearest"}
    scene = {
        "integrator": {"type": "path", "max_depth": 2},
        "sky": {"type": "constant"},
        "s": {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": image}},
    }
    o, d = rays_at((0.0, 0.0, 0.0), 1.0, 32, seed=1)
    assert np.abs(deviations(scene, o, d, 128)).max() < 5.5
