"""Scenes as Mitsuba scene files: what we read of them is the same scene, and Mitsuba hits the same.

The picture of the scene that is read has the same bits where Mitsuba has the shapes; where a mesh
or an instance stands in, hits are the same to its error.
"""

import warnings
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke
from galleries import gallery_of_lights, gallery_of_materials

import reference_rt as rt
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.scene import for_rays, picture
from comparisons.rungs.rays.camera import camera_rays
from comparisons.translator.writing import write_xml
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene

LACKING = (*(path.stem for path in SCENES.glob("csg_*.yaml")), "texture_product")
"""Mitsuba has no set operations, and no products of textures in its files."""

APPROXIMATE = {
    "camera_orthographic": "the picture's edges are computed from its middle",
    "camera_pinhole": "the picture's edges are computed from an angle",
    "camera_view_rectangle": "the picture's edges are computed from an angle",
    "cylinders_and_cones": "meshes",
    "display_modes": "its mesh has colours, in float32",
    "far_origin": "a capped cylinder is three shapes",
    "grazing": "ellipsoids are instances",
    "instances_lit": "copies of copies have one matrix, which is rounded",
    "light_shapes": "meshes",
    "mesh_colours": "colours in float32",
    "mesh_knot": "normals are made unit again",
    "needle": "ellipsoids are instances",
    "phong_spheres": "a plane that ends",
    "planet": "ellipsoids",
    "polygons_fill_rules": "meshes",
    "quadrics": "meshes",
    "textured_curves": "meshes",
    "textured_room": "a box with a texture is a mesh",
    "tilted_lamps": "triangles",
    "tiny": "a capped cylinder is three shapes",
    "transforms": "meshes",
}
"""Scenes of which Mitsuba lacks a part, with what stands in for it."""

FEW = ("camera_thin_lens", "material_normal_map", "light_spot", "whitted_classic")
"""In the fast tests."""


def round_trip(scene: Scene, folder: Path) -> Scene:
    write_xml(scene, folder / "scene.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return Scene.load(folder / "scene.xml")


def small(scene: Scene, spp: int = 4) -> Scene:
    """A picture of some 300 pixels."""
    width, height = scene.film.width, scene.film.height
    size = {"width": 24, "height": max(1, round(24 * height / width)), "layers": ()}
    sampler = scene.resolved_sampler.model_copy(update={"spp": spp})
    return scene.changed(film=scene.film.model_copy(update=size), sampler=sampler)


def assert_same_bits(scene: Scene, read: Scene) -> None:
    ours, theirs = (rt.render(small(one)).colour for one in (scene, read))
    assert ours.any()
    assert ours.tobytes() == theirs.tobytes()


def can_be_written(scene: Scene, folder: Path) -> bool:
    try:
        write_xml(scene, folder / "scene.xml")
    except rt.SceneError:  # it has no counterpart among Mitsuba's
        return False
    return True


@pytest.mark.parametrize("gallery", [gallery_of_materials, gallery_of_lights])
def test_every_material_texture_and_light_is_read_to_the_same_bits(gallery, tmp_path):
    scene = gallery(tmp_path)
    kept = [s for s in scene.shapes if can_be_written(scene.changed(shapes=[s]), tmp_path)]
    assert len(scene.shapes) - len(kept) <= 5  # products, two wraps, normal maps by `follow_v`
    scene = scene.changed(shapes=kept)
    assert_same_bits(scene, round_trip(scene, tmp_path))


NAMES = [
    pytest.param(path.stem, marks=() if path.stem in FEW else pytest.mark.slow)
    for path in sorted(SCENES.glob("*.yaml"))
    if path.stem not in LACKING and path.stem not in APPROXIMATE
]


@pytest.mark.parametrize("name", NAMES)
def test_scenes_are_read_to_the_same_bits(name, tmp_path):
    scene = Scene.load(SCENES / f"{name}.yaml")
    assert_same_bits(scene, round_trip(scene, tmp_path))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("grazing", "tiny") else pytest.mark.slow)
        for name in APPROXIMATE
    ],
)
def test_scenes_with_stand_ins_are_hit_alike(name, tmp_path):
    """Of 400 camera rays all but those at edges hit at the same distance."""
    scene = small(Scene.load(SCENES / f"{name}.yaml"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_xml(scene, tmp_path / "scene.xml")
        read = Scene.load(tmp_path / "scene.xml")
        # In float32 the smallest triangles of a stand-in may lose their area, which is said here.
        tables = [one.tables for one in (scene, read)]
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, scene.film.width, 400), rng.uniform(0, scene.film.height, 400)
    rays = camera_rays(scene, x, y)
    ours, theirs = (query.intersect(one, *rays).t for one in tables)
    same = np.isclose(ours, theirs, rtol=1e-5, atol=0.0) | (ours == theirs)
    assert same.mean() > 0.98


@pytest.mark.parametrize("name", ["cornell_box", "light_spot", "grazing", "tiny"])
def test_mitsuba_loads_them_and_hits_the_same(name, tmp_path):
    """In float32, and but for rays that start nearer to edges than it resolves."""
    scene = small(Scene.load(SCENES / f"{name}.yaml"))
    write_xml(scene, tmp_path / "scene.xml")
    mitsuba()
    with scalar() as mi:
        loaded = mi.load_file(str(tmp_path / "scene.xml"))
        rng = np.random.default_rng(1)
        x, y = rng.uniform(0, scene.film.width, 300), rng.uniform(0, scene.film.height, 300)
        o, d = camera_rays(scene, x, y)

        def distance(o, d):
            si = loaded.ray_intersect(mi.Ray3f(mi.Point3f(o), d))
            return (si.t,)

        theirs = for_rays(distance, o, d)[0]
    ours = query.intersect(scene.tables, o, d).t
    same = np.isclose(ours, theirs, rtol=1e-3, atol=0.0) | (ours == theirs)
    assert same.mean() > 0.97


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["whitted_classic", "spheres_whitted"])
@pytest.mark.parametrize("set_variant", [scalar, nullcontext])
def test_mitsuba_renders_whitted_scenes_with_our_plugin(name, set_variant, tmp_path):
    """Without noise: `stratified` takes the middles of its cells in both, in float32 there."""
    scene = small(Scene.load(SCENES / f"{name}.yaml"), spp=16)
    _, notes = write_xml(scene, tmp_path / "scene.xml")
    assert any("'whitted'" in note for note in notes)
    ours = float(np.mean(rt.render(scene).colour))
    mitsuba()
    with set_variant():
        theirs = float(picture(mitsuba().load_file(str(tmp_path / "scene.xml")), 16, 0).mean())
    assert theirs == pytest.approx(ours, rel=1e-6)


def test_the_command_writes_all_or_nothing(tmp_path):
    found = invoke("convert", SCENES / "material_blend.yaml", "-o", tmp_path / "a.xml")
    assert found.exit_code == 0, found.output
    assert (tmp_path / "a_files").is_dir()
    assert Scene.load(tmp_path / "a.xml").materials
    found = invoke("convert", SCENES / "csg_dice.yaml", "-o", tmp_path / "b.xml")
    assert found.exit_code != 0
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["a.xml", "a_files"]


def test_what_mitsuba_lacks_is_named(tmp_path):
    with pytest.raises(rt.SceneError, match="CSG"):
        write_xml(Scene.load(SCENES / "csg_dice.yaml"), tmp_path / "a.xml")
    _, notes = write_xml(Scene.load(SCENES / "phong_spheres.yaml"), tmp_path / "b.xml")
    assert any("textbook_phong" in note for note in notes)
    assert "textbook_phong" in (tmp_path / "b.xml").read_text()
