"""The rung `files` sees what both renderers share: faults of readers, transforms and tables, which
no other rung can see, since Mitsuba is fed from the same."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import SCENES
from mesh_writers import FACES, POINTS, SQUARE, TRIANGLES, XYZ, Gltf, binary_stl, ply

from comparisons.experiments.fuzz import random_files
from comparisons.rungs import files
from reference_rt.core import transform
from reference_rt.core.image_files import float_files
from reference_rt.lights.emitters import environment_map
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Cylinder, Sphere, Torus, instances, shape
from reference_rt.shapes.meshes import mesh as meshes
from reference_rt.shapes.meshes import topology
from reference_rt.textures import bitmap, image_file

Patch = pytest.MonkeyPatch


def _data(change: Callable[[Any], dict[str, Any]]) -> Callable[[Patch], None]:
    """A fault in reading meshes: these fields in place of what was read."""
    read = meshes.read_mesh

    def plant(patch: Patch) -> None:
        patch.setattr(meshes, "read_mesh", lambda p: replace(d := read(p), **change(d)))

    return plant


def _result(owner: Any, name: str, change: Callable[[Any], Any]) -> Callable[[Patch], None]:
    """A fault in what a function returns."""
    right = getattr(owner, name)

    def plant(patch: Patch) -> None:
        patch.setattr(owner, name, lambda *given, **more: change(right(*given, **more)))

    return plant


def _argument(owner: Any, name: str, change: Callable[..., Any]) -> Callable[[Patch], None]:
    """A fault in what a function is called with."""
    right = getattr(owner, name)
    return lambda patch: patch.setattr(owner, name, lambda *given: right(*change(*given)))


def _field(owner: Any, name: str, change: Callable[[Any], Any]) -> Callable[[Patch], None]:
    """A fault in a description's number on its way into the table."""
    right = owner.tabulate

    def tabulate(self: Any, context: Any) -> Any:
        return right(self.model_copy(update={name: change(getattr(self, name))}), context)

    return lambda patch: patch.setattr(owner, "tabulate", tabulate)


def _normals_by_the_matrix(m: Any, normals: Any) -> Any:
    mapped = normals @ m[:, :3].T
    return mapped / np.linalg.norm(mapped, axis=1, keepdims=True)


def _half_a_mantissa(patch: Patch) -> None:
    right = float_files._radiance
    patch.setattr(float_files, "_radiance", lambda rgbe, middle: right(rgbe, 0.5))


PLANTED: dict[str, tuple[str, Callable[[Patch], None], str]] = {
    "meshes too large": ("mesh_knot", _data(lambda d: {"vertices": 1.05 * d.vertices}), "is at"),
    "v upside down": (
        "petal",
        _data(lambda d: {"uv": None if d.uv is None else d.uv * [1.0, -1.0] + [0.0, 1.0]}),
        "has the uv",
    ),
    "the last face lost": ("mesh_knot", _data(lambda d: {"faces": d.faces[:-1]}), "lacks triangle"),
    "faces wound in reverse": (
        "mesh_knot",
        _data(lambda d: {"faces": d.faces[:, [0, 2, 1]]}),
        "is at",
    ),
    "corners turned": ("mesh_knot", _data(lambda d: {"faces": d.faces[:, [1, 2, 0]]}), "is at"),
    "uv made up": ("mesh_knot", _data(lambda d: {"uv": d.vertices[:, :2]}), "finds none"),
    "normals lost": ("mesh_knot", _data(lambda d: {"normals": None}), "has the normal"),
    "normals by the matrix": (
        "stretched",
        lambda patch: patch.setattr(transform, "apply_normals", _normals_by_the_matrix),
        "has the normal",
    ),
    "x and y exchanged": (
        "mesh_knot",
        _data(lambda d: {"vertices": d.vertices[:, [1, 0, 2]]}),
        "is at",
    ),
    "spheres too large": ("transforms", _field(Sphere, "radius", lambda r: 1.05 * r), "off the"),
    "tori too thick": ("torus", _field(Torus, "minor_radius", lambda r: 1.05 * r), "off the"),
    "cylinders too long": ("transforms", _field(Cylinder, "z_max", lambda z: 1.05 * z), "off the"),
    "angles in radians": (
        "transforms",
        _result(transform, "rotate", lambda m: transform.compose(m, m)),
        "off the",
    ),
    "scales undone": ("transforms", _result(transform, "scale", transform.invert), "off the"),
    "steps in reverse": (
        "transforms",
        lambda patch: patch.setattr(
            shape, "affine", lambda steps: transform.compose(*(s.matrix_of() for s in steps[::-1]))
        ),
        "off the",
    ),
    "a sky's contrast": (
        "environment",
        _result(environment_map, "read_image", lambda texels: texels**1.2),
        "the pixel at",
    ),
    "a sky moved by a texel": (
        "environment",
        _result(environment_map, "read_image", lambda texels: np.roll(texels, 1, axis=1)),
        "the pixel at",
    ),
    "a sky that is turned": (
        "environment",
        _result(environment_map, "orthogonal", lambda m: m @ transform.rotate((0, 1, 0), 2)[:, :3]),
        "turns directions",
    ),
    "repeated images clamped at their last texel": (
        "texture_filters",
        _argument(bitmap, "_wrapped", lambda i, n, wrap: (i - (i == n and wrap == 0), n, wrap)),
        "places at borders of texels differ; ",
    ),
    "mirrored images that repeat the edge twice": (
        "texture_filters",
        _argument(bitmap, "_wrapped", lambda i, n, wrap: (i + (i == 2 * n and wrap == 2), n, wrap)),
        "textures.flipped: tiles.png: ",
    ),
    "a sky's first column lost": (
        "environment",
        _argument(environment_map, "_texel", lambda sky, row, x: (sky, row, np.maximum(x, 1))),
        "places at borders of texels differ; ",
    ),
    ".hdr half a mantissa brighter": ("hdr", _half_a_mantissa, "the pixel at"),
    "sRGB decoded twice": (
        "texture_filters",
        _result(image_file, "linear", lambda x: np.power(x, 2.2)),
        "the pixel at",
    ),
}


def parsed(folder: Path, **parts: Any) -> Scene:
    return Scene.parse(json.dumps(parts), folder=folder)


def scene_of(name: str, folder: Path) -> Scene:
    if name == "stretched":
        knot = {"type": "mesh", "file": str(SCENES / "meshes" / "knot.obj")}
        return parsed(folder, shapes=[{**knot, "transform": [{"scale": [1, 2, 3]}]}])
    if name == "petal":
        return parsed(folder, shapes=[{"type": "mesh", "file": str(SCENES / "meshes/petal.ply")}])
    if name == "torus":
        tilt = [{"rotate": {"axis": [1, 2, 0], "degrees": 33}}, {"scale": [1, 0.5, 2]}]
        return parsed(folder, shapes=[{"type": "torus", "transform": tilt}])
    if name == "hdr":
        header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n"
        pixels = bytes(b for k in range(8) for b in (9 + 30 * k, 200 - k, 128, 110 + 3 * k))
        (folder / "sky.hdr").write_bytes(header + pixels)
        sky = {"type": "environment_map", "file": "sky.hdr"}
        return parsed(folder, lights=[sky])
    return Scene.load(SCENES / f"{name}.yaml")


@pytest.mark.parametrize("name", PLANTED)
def test_faults_that_both_renderers_share(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    which, plant, said = PLANTED[name]
    right = files(scene_of(which, tmp_path))
    assert right.status == "agree", right.reason
    plant(monkeypatch)
    found = files(scene_of(which, tmp_path))
    assert found.status == "differ"
    assert said in found.reason


FORMATS: dict[str, bytes] = {
    "a.stl": binary_stl(TRIANGLES),
    "a.off": b"OFF\n5 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 2\n3 0 1 4\n4 0 1 2 3\n3 4 2 1\n",
    "a.gltf": Gltf().gltf(),
    "a.glb": Gltf().glb(),
    "a.obj": b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 .5 0\nf 1 2 3 4 5\nf 1 2 3\n",
    "a.ply": ply("ascii", ("vertex", XYZ, SQUARE.tolist()), ("face", FACES, [[[0, 1, 2, 3]]])),
}
"""A file of each format that has a second reader, those with polygons of four and five corners."""


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_with_a_second_reader(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    (tmp_path / name).write_bytes(FORMATS[name])
    turn = [{"rotate": {"axis": [1, 2, 3], "degrees": 40}}, {"scale": [1, -2, 3]}]
    scene = parsed(tmp_path, shapes=[{"type": "mesh", "file": name, "transform": turn}])
    right = files(scene)
    assert right.status == "agree", right.reason
    assert right.numbers["checked"] == {"meshes": 1}
    PLANTED["meshes too large"][1](monkeypatch)
    assert files(scene).status == "differ"


def test_what_nobody_else_reads_is_named(tmp_path: Path) -> None:
    outline = [[0, 0], [1, 0], [0, 1]]
    np.save(tmp_path / "a.npy", np.ones((2, 4, 3)))
    sky = {"type": "environment_map", "file": "a.npy"}
    found = files(parsed(tmp_path, shapes=[{"type": "polygon", "rings": [outline]}], lights=[sky]))
    assert found.status == "not-applicable"
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
    assert right.numbers["checked"]["meshes"] >= len(random_files.MESHES) - 1  # some .ply
    plant = ("meshes too large", "faces wound in reverse", "sRGB decoded twice")[number % 3]
    PLANTED[plant][1](monkeypatch)
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
    _result(instances, "composed", lambda maps: maps[::-1])(monkeypatch)
    assert "has the map" in files(scene).reason
