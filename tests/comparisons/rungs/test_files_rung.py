"""The rung `files` sees what both renderers share: faults of readers, transforms and tables, which
no other rung can see, since Mitsuba is fed from the same."""

import json
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from builders import SCENES
from faulty_sources import SOURCE_FAULTS, plant
from mesh_writers import (
    FACES,
    FORMS,
    POINTS,
    SQUARE,
    TRIANGLES,
    XYZ,
    Gltf,
    binary_stl,
    model_3mf,
    ply,
)

from comparisons.experiments.fuzz import random_files
from comparisons.rungs import files
from reference_rt.core.image_files import float_files
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import instances
from reference_rt.shapes.meshes import mesh as meshes
from reference_rt.shapes.meshes import topology

Patch = pytest.MonkeyPatch


def _data(change: Callable[[Any], dict[str, Any]]) -> Callable[[Patch], None]:
    """A fault in reading meshes: these fields in place of what was read."""
    read = meshes.read_mesh

    def plant(patch: Patch) -> None:
        patch.setattr(meshes, "read_mesh", lambda p: replace(d := read(p), **change(d)))

    return plant


SAID = {
    "meshes 5 % too large": "is at",
    "last face of meshes lost": "lacks triangle",
    "v of meshes upside down": "has the uv",
    "uv of meshes made up": "finds none",
    "normals by the matrix": "has the normal",
    "`smooth` ignored": "no corner has the normal that the description finds",
    "spheres under a transform 5 % too large": "off the",
    "cylinders too long": "off the",
    "tori too thick": "off the",
    "steps in reverse order": "off the",
    "instances without their scale": "has the map",
    "a sky's texels to the power of 1.2": "the pixel at",
    "a sky turned backwards": "turns directions",
    "repeated images clamped at their last texel": "places at borders of texels differ; ",
    "mirrored wrap that repeats the edge twice": "textures.flipped: tiles.png: ",
    "a sky clamped at its seam": "places at borders of texels differ; ",
    "sRGB decoded twice": "the pixel at",
}
"""A part of what the rung says to some."""


@pytest.mark.parametrize("name", [f.name for f in SOURCE_FAULTS.values() if f.rung == "files"])
def test_faults_that_both_renderers_share(name: str, monkeypatch: Patch) -> None:
    fault = SOURCE_FAULTS[name]
    path = SCENES / f"{fault.scene}.yaml"
    right = files(Scene.load(path))
    assert right.status == "agree", right.reason
    plant(monkeypatch, fault)
    found = files(Scene.load(path))
    assert found.status == "differ"
    assert SAID.get(name, "") in found.reason


def parsed(folder: Path, **parts: Any) -> Scene:
    return Scene.parse(json.dumps(parts), folder=folder)


def test_an_hdr_half_a_mantissa_brighter(tmp_path: Path, monkeypatch: Patch) -> None:
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n"
    pixels = bytes(b for k in range(8) for b in (9 + 30 * k, 200 - k, 128, 110 + 3 * k))
    (tmp_path / "sky.hdr").write_bytes(header + pixels)
    sky = {"type": "environment_map", "file": "sky.hdr"}
    assert files(parsed(tmp_path, lights=[sky])).status == "agree"
    right = float_files._radiance
    monkeypatch.setattr(float_files, "_radiance", lambda rgbe, middle: right(rgbe, 0.5))
    assert "the pixel at" in files(parsed(tmp_path, lights=[sky])).reason


def _gltf_of_zeros() -> bytes:
    """With texture coordinates that no view has."""
    file = Gltf()
    accessor = {"componentType": 5126, "type": "VEC2", "count": len(POINTS)}
    file.accessors.append(accessor)
    file.primitive["attributes"]["TEXCOORD_0"] = len(file.accessors) - 1
    file.primitive["material"], file.root["materials"] = 0, [{}]
    return file.gltf()


def _archive() -> bytes:
    with TemporaryDirectory() as folder:
        faces = [[0, 1, 4], [0, 1, 2], [4, 2, 1]]
        return model_3mf(Path(folder), POINTS.tolist(), faces, unit="inch").read_bytes()


FORMATS: dict[str, bytes] = {
    "a.stl": binary_stl(TRIANGLES),
    "a.off": b"OFF\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 2\n3 0 1 4\n4 0 1 2 3\n3 4 2 1\n",
    "a.gltf": Gltf().gltf(),
    "a.glb": Gltf().glb(),
    "a.obj": b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 .5 0\nf 1 2 3 4 5\nf 1 2 3\n",
    "a.ply": ply("ascii", ("vertex", XYZ, SQUARE.tolist()), ("face", FACES, [[[0, 1, 2, 3]]])),
    "zeros.gltf": _gltf_of_zeros(),
    "a.3mf": _archive(),
}
"""A file of each format that has a second reader, those with polygons of four and five corners."""


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_with_a_second_reader(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    if name.endswith(".3mf"):
        pytest.importorskip("lib3mf")
    (tmp_path / name).write_bytes(FORMATS[name])
    turn = [{"rotate": {"axis": [1, 2, 3], "degrees": 40}}, {"scale": [1, -2, 3]}]
    scene = parsed(tmp_path, shapes=[{"type": "mesh", "file": name, "transform": turn}])
    right = files(scene)
    assert right.status == "agree", right.reason
    assert right.numbers["checked"] == {"meshes": 1}
    plant(monkeypatch, SOURCE_FAULTS["meshes 5 % too large"])
    assert files(scene).status == "differ"


def test_what_nobody_else_reads_is_named(tmp_path: Path) -> None:
    outline = [[0, 0], [1, 0], [0, 1]]
    np.save(tmp_path / "a.npy", np.ones((2, 4, 3)))
    sky = {"type": "environment_map", "file": "a.npy"}
    found = files(parsed(tmp_path, shapes=[{"type": "polygon", "rings": [outline]}], lights=[sky]))
    assert (found.status, found.numbers["checked"]) == ("agree", {})
    assert found.numbers["unread"] == [".npy", "polygon"]


def test_many_shapes_take_as_long_as_some(tmp_path: Path) -> None:
    balls = [{"type": "sphere", "center": [k, 0, 0]} for k in range(1001)]
    assert files(parsed(tmp_path, shapes=balls)).numbers["checked"] == {"spheres": 167}


@pytest.mark.parametrize("number", range(5))
def test_random_files(number: int, tmp_path: Path, monkeypatch: Patch) -> None:
    """`fuzz --rungs files`: no reader of ours differs, and one that is wrong does."""
    scene = Scene.parse(json.dumps(random_files.scene(38, number, tmp_path)), folder=tmp_path)
    right = files(scene)
    assert right.status == "agree", right.reason
    assert right.numbers["checked"]["images"] == len(random_files.IMAGES)
    least = len(random_files.MESHES) - 1 - (find_spec("lib3mf") is None)  # without some .ply
    assert right.numbers["checked"]["meshes"] >= least
    fault = ("meshes 5 % too large", "faces wound in reverse", "sRGB decoded twice")[number % 3]
    plant(monkeypatch, SOURCE_FAULTS[fault])
    assert files(scene).status == "differ"


@pytest.mark.parametrize("what", ["normals", "uv"])
def test_normals_and_uv_of_gltf(what: str, tmp_path: Path, monkeypatch: Patch) -> None:
    file, rng = Gltf(), np.random.default_rng(3)
    normals = rng.normal(size=POINTS.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    file.primitive["material"] = 0
    file.root["materials"] = [{}]
    file.primitive["attributes"] |= {
        "NORMAL": file.add(normals.astype("<f4")),
        "TEXCOORD_0": file.add(rng.uniform(size=(len(POINTS), 2)).astype("<f4")),
    }
    file.root["nodes"][0]["scale"] = [1, 2, 3]
    (tmp_path / "a.glb").write_bytes(file.glb())
    scene = parsed(tmp_path, shapes=[{"type": "mesh", "file": "a.glb"}])
    right = files(scene)
    assert right.status == "agree", right.reason
    _data(lambda d: {what: getattr(d, what)[::-1]})(monkeypatch)
    assert f"has the {what.removesuffix('s')}" in files(scene).reason


@pytest.mark.parametrize("form", FORMS)
def test_uv_of_corners(form: str, tmp_path: Path, monkeypatch: Patch) -> None:
    """Of the faces of a .ply file, which Mitsuba does not read."""
    corners = [[[0, 1, 2], [0, 0, 0.5, 0, 0.5, 1]], [[0, 2, 3], [0.25, 0.25, 0.75, 0, 1, 1]]]
    properties = [*FACES, "list uchar float texcoord"]
    content = ply(form, ("vertex", XYZ, SQUARE.tolist()), ("face", properties, corners))
    (tmp_path / "a.ply").write_bytes(content)
    scene = parsed(tmp_path, shapes=[{"type": "mesh", "file": "a.ply"}])
    right = files(scene)
    assert right.status == "agree", right.reason
    assert right.numbers["checked"] == {"meshes": 1}
    _data(lambda d: {"uv": d.uv[::-1]})(monkeypatch)
    assert "has the uv" in files(scene).reason


def test_smooth_normals(tmp_path: Path, monkeypatch: Patch) -> None:
    corners = np.random.default_rng(4).normal(size=(7, 3)).tolist()
    faces = [[0, k, k + 1] for k in range(1, 6)]
    mesh = {"type": "mesh", "vertices": corners, "faces": faces, "smooth": True}
    scene = parsed(tmp_path, shapes=[{**mesh, "transform": [{"scale": [1, -2, 0.5]}]}])
    right = files(scene)
    assert right.status == "agree", right.reason
    by_angle = topology._normals_and_angles

    def equally(corners: Any) -> Any:
        normals, angles = by_angle(corners)
        return normals, np.ones_like(angles)

    monkeypatch.setattr(topology, "_normals_and_angles", equally)
    assert "has the normal" in files(scene).reason


@pytest.mark.parametrize("width", [1e-16, 1e-12, 1e-6])
def test_smooth_normals_of_needles(width: float) -> None:
    """Triangles of hardly any width have no normal that rounding leaves alone."""
    rng = np.random.default_rng(5)
    for _ in range(10):
        points = rng.normal(size=(12, 3))
        along = points[0] + (points[1] - points[0]) * rng.uniform(size=(4, 1))
        points[4:8] = along + width * rng.normal(size=(4, 3))
        faces = [rng.permutation(12)[:3].tolist() for _ in range(14)]
        faces += [[0, 1, k] for k in range(4, 8)]
        mesh = {"type": "mesh", "vertices": points.tolist(), "faces": faces, "smooth": True}
        found = files(parsed(Path(), shapes=[mesh]))
        assert found.status == "agree", found.reason


def test_colours_of_vertices(monkeypatch: Patch) -> None:
    scene = Scene.load(SCENES / "mesh_colours.yaml")
    assert files(scene).status == "agree"
    _data(lambda d: {"colours": d.colours[:, [2, 1, 0]]})(monkeypatch)
    assert "has the colour" in files(scene).reason


def test_maps_of_instances(tmp_path: Path, monkeypatch: Patch) -> None:
    np.save(tmp_path / "maps.npy", np.random.default_rng(2).normal(size=(3, 3, 4)))
    copies = {"type": "instance", "group": "g", "file": "maps.npy"}
    turn = [{"rotate": {"axis": [1, 2, 3], "degrees": 40}}]
    ball = {"g": [{"type": "sphere"}]}
    scene = parsed(tmp_path, groups=ball, shapes=[{**copies, "transform": turn}])
    assert files(scene).status == "agree"
    right = instances.composed
    monkeypatch.setattr(instances, "composed", lambda *maps: right(*maps)[::-1])
    assert "has the map" in files(scene).reason
