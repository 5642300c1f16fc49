"""`convert --to json`: a scene that is rebuilt from the data has the same surfaces."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke
from galleries import gallery_of_lights, gallery_of_shapes

import reference_rt as rt
from comparisons.rungs.rays.camera import camera_rays
from comparisons.translator.resolved import is_closed, tessellated, write_resolved
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.shapes.csg import Difference, Intersection, Union

OPERATIONS = {"union": Union, "intersection": Intersection, "difference": Difference}


def shape_of(value: dict[str, Any], document: dict[str, Any], material: str | None = None) -> Any:
    material = value.get("material") or material
    if "operation" in value:
        of = tuple(shape_of(part, document, material) for part in value["of"])
        return OPERATIONS[value["operation"]](of=of)
    if "plane" in value:
        return rt.Plane(transform=({"matrix": value["plane"]},), material=material)
    file = document["meshes"][value["mesh"]]["file"]
    return rt.Mesh(file=file, transform=({"matrix": value["transform"]},), material=material)


def rebuilt(scene: Scene, folder: Path) -> tuple[Scene, dict[str, Any]]:
    write_resolved(scene, folder / "out.json")
    document = json.loads((folder / "out.json").read_text())
    shapes = tuple(shape_of(value, document) for value in document["shapes"])
    materials = {name: {"type": "diffuse"} for name in document["materials"]}
    found = Scene(shapes=shapes, materials=materials)
    found._folder = folder
    return found, document


def assert_same_surfaces(scene: Scene, folder: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found, document = rebuilt(scene, folder)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, scene.film.width, 500), rng.uniform(0, scene.film.height, 500)
    o, d = camera_rays(scene, x, y)
    ours, theirs = query.intersect(scene.tables, o, d), query.intersect(found.tables, o, d)
    off = max((mesh["distance"] for mesh in document["meshes"]), default=0.0)
    met = np.isfinite(ours.t) & np.isfinite(theirs.t)
    gap = np.abs(np.where(met, ours.t, 0.0) - np.where(met, theirs.t, 0.0))
    cosine = np.abs(np.sum(ours.n * d, axis=1))
    near = gap * cosine <= 4.0 * off + 1e-6 * np.maximum(1.0, np.where(met, ours.t, 0.0))
    same = np.where(met, near, np.isinf(ours.t) & np.isinf(theirs.t))
    assert same.mean() > 0.985
    shading = np.sum(ours.ns * theirs.ns, axis=1)[met & near]
    assert np.quantile(shading, 0.02) > 0.99
    numbers = np.array([value["shape"] for value in document["shapes"]])
    assert (numbers[theirs.shape] == ours.shape)[met & near].mean() > 0.98


@pytest.mark.slow
@pytest.mark.parametrize("gallery", [gallery_of_shapes, gallery_of_lights])
def test_every_shape(gallery, tmp_path):
    scene = gallery(tmp_path)
    (tmp_path / "out").mkdir()
    assert_same_surfaces(scene, tmp_path / "out")


@pytest.mark.parametrize(
    "name",
    [
        "display_modes",
        "polygons_fill_rules",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("transforms", "cylinders_and_cones", "csg_dice", "csg_nested")
        ),
    ],
)
def test_scenes(name, tmp_path):
    assert_same_surfaces(Scene.load(SCENES / f"{name}.yaml"), tmp_path)


def test_everything_is_there(tmp_path):
    scene = gallery_of_lights(tmp_path)
    (tmp_path / "out").mkdir()
    write_resolved(scene, tmp_path / "out" / "a.json")
    found = json.loads((tmp_path / "out" / "a.json").read_text())
    assert found["format"] == "reference_rt resolved scene"
    # It is for other renderers: given to us, it is told in a sentence.
    with pytest.raises(rt.SceneError, match="1: is a reference_rt resolved scene, for other rende"):
        Scene.parse(json.dumps(found))
    assert [light["type"] for light in found["lights"]] == [light.type for light in scene.lights]
    assert found["materials"].keys() == scene.materials.keys()
    files = [found["textures"][name]["file"] for name in found["textures"]]
    files += [mesh["file"] for mesh in found["meshes"]]
    assert all((tmp_path / "out" / file).is_file() for file in files)
    l, r, b, t = found["camera"]["view"]
    assert (r - l) / (t - b) == pytest.approx(scene.film.width / scene.film.height)


def test_the_command(tmp_path):
    command = "convert", SCENES / "cornell_box.yaml", "--to", "json", "-o"
    found = invoke(*command, tmp_path / "a.json")
    assert found.exit_code == 0, found.output
    assert (tmp_path / "a_files").is_dir()
    found = invoke(*command, tmp_path / "a.yaml")
    assert found.exit_code != 0


SOLID = (
    rt.Box(),
    rt.Sphere(radius=0.7),
    rt.Sphere(transform=({"scale": (1.0, -0.4, 2.0)},)),
    rt.Cylinder(radius=0.3, z_min=-1.0, z_max=0.5),
    rt.Cone(radius=0.6, height=1.1),
    rt.Cone(radius=0.6, top_radius=0.2, height=1.1),
    rt.Torus(major_radius=1.0, minor_radius=0.3),
)


@pytest.mark.cases(2)
@pytest.mark.parametrize("shape", SOLID, ids=lambda s: s.type)
def test_what_encloses_space_is_closed(shape, tmp_path):
    """Our own set operations take them for operands."""
    found = tessellated(shape, tmp_path)
    assert is_closed(found.mesh)
    mesh = rt.Mesh(vertices=found.mesh.vertices, faces=found.mesh.faces)
    assert Scene(shapes=(Union(of=(mesh, rt.Box(transform=({"scale": 0.1},)))),)).tables
    assert not is_closed(tessellated(rt.Rectangle(), tmp_path).mesh)
