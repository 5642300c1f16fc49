"""Files of Mitsuba scenes: meshes, `Scene.load`, and `reference-rt convert`."""

import shutil
import struct
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke
from gltf_scenes import full_scene
from mesh_writers import packed
from mitsuba_dicts import hits_of, rays_at
from PIL import Image
from typer.testing import Result

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.files import write_scene
from comparisons.shapes import reading_meshes
from comparisons.translator.reading import read_file
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ImageError, SceneError, SceneWarning, UsageError

SCENE = """<scene version="3.0.0">
  <default name="spp" value="4"/>
  <integrator type="path"/>
  <sensor type="perspective">
    <transform name="to_world"><lookat origin="0, 1, 5" target="0, 0, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
    <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="9"/></film>
  </sensor>
  <bsdf type="twosided" id="picture"><bsdf type="diffuse">
    <texture type="bitmap" name="reflectance"><string name="filename" value="images/a.png"/>
    </texture></bsdf></bsdf>
  <bsdf type="diffuse" id="other">
    <texture type="bitmap" name="reflectance"><string name="filename" value="more/a.png"/>
    </texture></bsdf>
  <bsdf type="diffuse" id="coloured">
    <texture type="mesh_attribute" name="reflectance"><string name="name" value="NAME"/></texture>
  </bsdf>
  <shape type="obj"><string name="filename" value="quad.obj"/><ref id="picture"/>
    <transform name="to_world"><rotate y="1" angle="20"/></transform></shape>
  <shape type="ply"><string name="filename" value="coloured.ply"/><ref id="coloured"/></shape>
  <shape type="serialized"><string name="filename" value="two.serialized"/>
    <integer name="shape_index" value="1"/><ref id="other"/></shape>
  <shape type="shapegroup" id="group"><shape type="cube"><ref id="picture"/></shape></shape>
  <shape type="instance"><ref id="group"/>
    <transform name="to_world"><scale value="0.2"/><translate x="1"/></transform></shape>
  <emitter type="envmap"><string name="filename" value="images/sky.png"/></emitter>
</scene>
"""

PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float r
property float g
property float b
element face 2
property list uchar int vertex_indices
property float r
property float g
property float b
end_header
-1 0 -1 0.1 0.2 0.3
1 0 -1 0.9 0.2 0.3
1 0.5 -1 0.1 0.8 0.3
-1 0.5 -1 0.1 0.2 0.7
3 0 1 2 0.5 0.25 0.125
3 0 2 3 0.75 0.5 0.25
"""


CORNERS = np.array([[-1.0, 0, 0], [1, 0, 0], [1, 1, 0.3], [-1, 1, 0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
UPWARDS = np.array([[0.0, 0, 1], [0, 0.6, 0.8], [0, 0, 1], [0.6, 0, 0.8]])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene with files in several folders, two of them of the same name."""
    rng = np.random.default_rng(1)
    for name in ("images/a", "images/sky", "more/a"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        pixels = rng.integers(0, 255, (4, 8, 3), dtype=np.uint8)
        Image.fromarray(pixels).save(tmp_path / f"{name}.png")
    lines = [f"v {x} {y} {z}\nvt {x / 3} {y}" for x, y, z in CORNERS]
    (tmp_path / "quad.obj").write_text("\n".join([*lines, "f 1/1 2/2 3/3 4/4"]))
    (tmp_path / "coloured.ply").write_text(PLY)
    one, two = (CORNERS, TRIANGLES, None, False), (CORNERS + 0.1, TRIANGLES, UPWARDS, True)
    (tmp_path / "two.serialized").write_bytes(packed(4, one, two))
    (tmp_path / "scene.xml").write_text(SCENE.replace("NAME", "vertex_color"))
    return tmp_path


def run(*arguments: object) -> Result:
    return invoke("convert", *arguments)


def test_a_converted_scene_is_the_same(folder):
    scene = read_file(folder / "scene.xml", Scene, {"spp": "16"})
    out = folder / "out" / "deep" / "scene.yaml"
    result = run(folder / "scene.xml", "-o", out, "-D", "spp=16")
    assert result.exit_code == 0, result.output
    written = Scene.load(out)
    names = sorted(path.name for path in (out.parent / "scene_files").iterdir())
    assert names == sorted(
        ["a.png", "a_2.png", "sky.png", "mesh.ply", "mesh_2.ply", "mesh_3.ply", "mesh_4.ply"]
    )
    assert sorted(p.name for p in out.parent.iterdir()) == ["scene.yaml", "scene_files"]
    o, d = rays_at((0.0, 0.3, 0.0), 1.5, 200, seed=1)
    for name in ("t", "n", "ns", "uv", "shape"):
        a, b = (getattr(s.intersect(o, d), name) for s in (scene, written))
        np.testing.assert_array_equal(a, b)
    a, b = (s.radiance(o, d, spp=4).mean for s in (scene, written))
    np.testing.assert_array_equal(a, b)
    assert written.resolved_sampler.spp == 16
    again = run(folder / "scene.xml", "-o", out)  # replaces the older one
    assert again.exit_code == 0
    assert Scene.load(out).resolved_sampler.spp == 4


def arrays_of(table: Any) -> list[Any]:
    return [a for part in table for a in arrays_of(part)] if isinstance(table, tuple) else [table]


def test_a_glb_file_is_converted(tmp_path, monkeypatch):
    """The scene that is written has the same tables, and needs neither the file nor the cache."""
    monkeypatch.setenv("REFERENCE_RT_CACHE", str(tmp_path / "cache"))
    (tmp_path / "model.glb").write_bytes(full_scene().glb())
    out = tmp_path / "out" / "scene.yaml"
    result = run(tmp_path / "model.glb", "-o", out, "-D", "camera=flat")
    assert result.exit_code == 0, result.output
    with pytest.warns(SceneWarning):
        scene = Scene.load(tmp_path / "model.glb", {"camera": "flat"})
    built = arrays_of(scene.tables.parts)
    shutil.rmtree(tmp_path / "cache")
    (tmp_path / "model.glb").unlink()
    written = Scene.load(out)
    assert (written.camera, written.film, written.lights) == (
        scene.camera,
        scene.film,
        scene.lights,
    )
    for ours, theirs in zip(arrays_of(written.tables.parts), built, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_nothing_is_written_for_a_broken_scene(folder):
    out = folder / "out" / "scene.yaml"
    (folder / "images" / "sky.png").unlink()
    result = run(folder / "scene.xml", "-o", out)
    assert result.exit_code == SceneError.exit_code
    assert "there is no file" in result.output
    assert not (folder / "out").exists()
    assert run(folder / "scene.xml", "-o", folder / "a.obj").exit_code == UsageError.exit_code
    assert run(folder / "scene.xml", "-o", out, "-D", "spp").exit_code == UsageError.exit_code


def test_a_failure_keeps_the_older_files(folder):
    scene = read_file(folder / "scene.xml", Scene)
    out = folder / "out" / "scene.json"
    assert write_scene(scene, out) == 7
    before = {p: p.read_bytes() for p in (folder / "out").rglob("*") if p.is_file()}
    (folder / "more" / "a.png").unlink()
    with pytest.raises(SceneError, match=r"textures.*no file"):
        write_scene(scene, out)
    assert {p: p.read_bytes() for p in (folder / "out").rglob("*") if p.is_file()} == before
    assert {p.name for p in (folder / "out").iterdir()} == {"scene.json", "scene_files"}
    (folder / "file").write_text("")
    with pytest.raises(ImageError):
        write_scene(scene, folder / "file" / "scene.yaml")


def test_links_to_the_files_and_to_their_folder_stay(folder):
    scene, out = read_file(folder / "scene.xml", Scene), folder / "out"
    (out / "elsewhere").mkdir(parents=True)
    (out / "scene_files").symlink_to("elsewhere")
    (out / "scene.json").symlink_to("other.json")
    for _ in range(2):
        assert write_scene(scene, out / "scene.json") == 7
        assert len(list((out / "elsewhere").iterdir())) == 7
        assert (out / "scene_files").is_symlink()
        assert (out / "scene.json").is_symlink()
        assert len(list(out.iterdir())) == 4
    Scene.load(out / "scene.json")


@pytest.mark.cases(3)
@pytest.mark.parametrize("kind", ["file", "folder", "name of a file"])
@pytest.mark.parametrize("converted", [False, True])
def test_files_of_others_are_not_lost(folder, kind, converted):
    """In the folder that a converted scene would have; also if there is a scene already."""
    out = folder / "out" / "scene.yaml"
    out.parent.mkdir()
    if converted:
        assert run(folder / "scene.xml", "-o", out).exit_code == 0
    files = out.parent / "scene_files"
    if kind == "name of a file" and not converted:
        files.write_text("mine")
    else:
        other = files / "mine" if kind == "folder" else files
        other.mkdir(parents=True, exist_ok=True)
        (other / "thesis.txt").write_text("mine")
    before = {p: p.read_bytes() for p in out.parent.rglob("*") if p.is_file()}
    result = run(folder / "scene.xml", "-o", out)
    assert result.exit_code == ImageError.exit_code
    assert "would be lost; expected" in result.output
    assert {p: p.read_bytes() for p in out.parent.rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("name", ["vertex_color", "face_color"])
def test_attributes_are_those_of_mitsuba(folder, name):
    path = folder / "scene.xml"
    path.write_text(SCENE.replace("NAME", name))
    scene = read_file(path, Scene)
    theirs = mitsuba().load_file(str(path), optimize=False)
    rng = np.random.default_rng(0)
    target = np.column_stack([rng.uniform(-0.9, 0.9, 50), rng.uniform(0.02, 0.48, 50)])
    target = np.column_stack([target, np.full(50, -1.0)])
    o = np.tile([0.0, 0.2, -9.0], (50, 1))
    d = (target - o) / np.linalg.norm(target - o, axis=1, keepdims=True)
    ours = scene.changed(integrator={"type": "ray_cast"}, sampler=None).radiance(o, d).mean
    mi = mitsuba()
    rays = mi.Ray3f(mi.Point3f(*o.T.astype(np.float32)), mi.Vector3f(*d.T.astype(np.float32)))
    si = theirs.ray_intersect(rays)
    found = np.array(si.bsdf().eval_diffuse_reflectance(si)).T
    np.testing.assert_allclose(ours, found, atol=1e-5)
    assert np.ptp(ours, axis=0).max() > 0.1


def test_an_attribute_that_is_missing_is_refused(folder):
    (folder / "scene.xml").write_text(SCENE.replace("NAME", "vertex_heat"))
    with pytest.raises(SceneError, match="no attribute 'vertex_heat'; expected one of: "):
        read_file(folder / "scene.xml", Scene)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("index", [0, 1, 2])
@pytest.mark.parametrize("flat", ["true", "false"])
def test_serialized_meshes_are_those_of_mitsuba(tmp_path, version, index, flat):
    meshes = (
        (CORNERS, TRIANGLES, None, False),
        (CORNERS * [1, 2, 1], TRIANGLES[:, ::-1], UPWARDS, True),
        (CORNERS * [1, 1, 3], TRIANGLES, UPWARDS, False),
    )
    (tmp_path / "m.serialized").write_bytes(packed(version, *meshes))
    (tmp_path / "scene.xml").write_text(
        f"""<scene version="3.0.0"><sensor type="perspective"/><shape type="serialized">
        <string name="filename" value="m.serialized"/><boolean name="face_normals" value="{flat}"/>
        <integer name="shape_index" value="{index}"/></shape></scene>"""
    )
    ours = read_file(tmp_path / "scene.xml", Scene)
    theirs = mitsuba().load_file(str(tmp_path / "scene.xml"))
    o, d = rays_at((0.0, 0.5, 0.0), 1.0, 300, seed=1)
    hits = ours.intersect(o, d)
    t, _, ns, uv = hits_of(theirs, o, d)
    met = np.isfinite(hits.t) & np.isfinite(t)
    assert met.sum() > 50
    np.testing.assert_allclose(hits.t[met], t[met], atol=1e-4)
    np.testing.assert_allclose(hits.ns[met], ns[met], atol=1e-3)
    np.testing.assert_allclose(hits.uv[met], uv[met], atol=1e-3)


def test_damaged_serialized_meshes_are_refused():
    whole = packed(4, (CORNERS, TRIANGLES, None, False), (CORNERS, TRIANGLES, UPWARDS, True))
    reading_meshes.read(whole, 1)
    for cut in range(0, len(whole) - 1, 7):
        with pytest.raises(ValueError, match=r"."):
            reading_meshes.read(whole[:cut], 1)
    for index in (-1, 2, 10**9):
        with pytest.raises(ValueError, match="has 2 meshes"):
            reading_meshes.read(whole, index)
    rng = np.random.default_rng(0)
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] = rng.integers(256)
        with suppress(ValueError):  # and nothing else
            reading_meshes.read(bytes(damaged), 1)


def test_serialized_meshes_that_unpack_to_much_are_refused():
    """Whatever their stream claims, no more is unpacked than that."""
    head = struct.pack("<HH", 0x041C, 4)
    cases = (b"a\0", 1 << 24, 1 << 28), (b"a\0", 1 << 60, 100), (b"a" * 99999, 1, 0)
    for name, count, length in cases:
        stream = struct.pack("<I", 0) + name + struct.pack("<QQ", count, 0) + bytes(length)
        content = head + zlib.compress(stream) + struct.pack("<QI", 0, 1)
        with pytest.raises(ValueError, match=r"unpacks from|a name without an end"):
            reading_meshes.read(content, 0)


def test_a_scene_of_mitsuba_loads_by_its_suffix(folder):
    """Needs the entry point of the installed package."""
    scene = Scene.load(folder / "scene.xml", {"spp": "9"})
    assert isinstance(scene, Scene)
    assert scene.resolved_sampler.spp == 9
    assert scene.name == "scene"
    with pytest.raises(SceneError, match="has no defaults"):
        Scene.load(folder / "scene.yaml", {"spp": "9"})
    found = Scene.from_mitsuba(
        {"type": "scene", "s": {"type": "obj", "filename": "quad.obj"}}, folder
    )
    assert len(found.shapes) == 1


def test_a_later_error_names_the_file(folder):
    scene = read_file(folder / "scene.xml", Scene)
    (folder / "images" / "a.png").write_bytes(b"no image")
    with pytest.raises(SceneError, match=r"scene\.xml: textures\."):
        _ = scene.tables
