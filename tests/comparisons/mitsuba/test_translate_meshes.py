"""Meshes in Mitsuba: numbers of triangles, arrays, colours under Mitsuba's own names, and vertex
normals that both sides make."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from comparisons.geometry.frame import UNIT_ROUNDOFF
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import trace
from comparisons.rungs import geometry
from comparisons.translator import load
from reference_rt.cameras import Perspective
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import RayCast
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Sphere
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.meshes.files import read_mesh
from reference_rt.shapes.shape import TabulationContext
from reference_rt.util.errors import SceneWarning


def uneven_ball() -> tuple[FloatArray, IntArray]:
    """A closed mesh, with faces of two equal corners at its start, in the middle and at its end."""
    ball = trimesh.creation.icosphere(2)
    rng = np.random.default_rng(4)
    vertices = ball.vertices * rng.uniform(0.9, 1.1, (len(ball.vertices), 1))
    vertices = vertices.astype(np.float32).astype(np.float64)
    faces = np.insert(ball.faces, [0, 0, 100, 200, 320], [[0, 0, 5]], axis=0)
    return vertices, faces.astype(np.int64)


def _scene(mesh: Mesh, where: str) -> Scene:
    view = Perspective(eye=(1.0, 2.0, 6.0), fov=40.0)
    common: dict[str, Any] = {"camera": view, "integrator": RayCast()}
    if where == "alone":
        return Scene(shapes=(mesh, Sphere(center=(2.0, 0.0, 0.0), radius=0.5)), **common)
    if where == "group":
        copies = (Instance(group="g"), Instance(group="g", transform=[{"translate": [2, 0, 0]}]))
        return Scene(shapes=copies, groups={"g": (mesh,)}, **common)
    return Scene(shapes=(mesh - Sphere(center=(0.0, 0.0, 1.0), radius=0.4),), **common)


@pytest.mark.cases(1)
@pytest.mark.parametrize(("where", "smooth"), [("alone", True), ("group", True), ("solid", False)])
def test_numbers_of_triangles_agree(where: str, smooth: bool) -> None:
    """Where faces without area are left out, and a transform mirrors."""
    vertices, faces = uneven_ball()
    mesh = Mesh(vertices=vertices, faces=faces, smooth=smooth, transform=[{"scale": [1, -1, 1]}])
    scene = _scene(mesh, where)
    with pytest.warns(SceneWarning, match="5 of 325 triangles have no area"):
        tables = scene.tables
    counterpart = load(scene)
    rung = geometry(scene, tables, counterpart, pixels=2_000)
    assert rung.status == "agree", rung.reason
    rng = np.random.default_rng(6)
    o = rng.normal(size=(2_000, 3)).astype(np.float32).astype(np.float64) * 3.0
    d = (rng.normal(size=(2_000, 3)) * 0.3 - o).astype(np.float32).astype(np.float64)
    ours, theirs = scene.intersect(o, d), trace(counterpart, o, d)
    met = (ours.shape == 0) & (theirs.shape == 0) & (ours.part == theirs.part) & (ours.part == 0)
    same = ours.primitive[met] == theirs.primitive[met]
    # Rays within float32's rounding of an edge may meet the neighbour.
    assert same.mean() > 0.995
    assert met.sum() > 500
    # Both ends of the mesh were met, and no number of a face without area.
    found = set(theirs.primitive[met].tolist())
    assert found <= set(np.flatnonzero([len(set(f)) == 3 for f in faces.tolist()]).tolist())
    assert min(found) < 20
    assert max(found) > 304


def test_colours_that_mitsuba_writes(tmp_path: Path) -> None:
    """The attribute `vertex_color` of a mesh, by `write_ply`."""
    mi = mitsuba()
    vertices, faces = uneven_ball()
    mesh = mi.Mesh("ball", len(vertices), len(faces))
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.astype(np.float32).ravel()
    values["faces"] = faces.astype(np.uint32).ravel()
    values.update()
    colours = np.random.default_rng(7).uniform(size=vertices.shape).astype(np.float32)
    mesh.add_attribute("vertex_color", 3, colours.ravel())
    mesh.add_attribute("face_id", 1, np.zeros(len(faces), np.float32))
    mesh.write_ply(str(tmp_path / "ball.ply"))
    found = read_mesh(tmp_path / "ball.ply")
    assert found.colours is not None
    assert np.array_equal(found.colours.astype(np.float32), colours)
    assert found.ignored == ("face id_0",)


NAMES = [
    "red green blue",
    "r g b",
    "color_0 color_1 color_2",
    "color_1 color_2 color_3",
    "color_x color_y color_z",
    "color_r color_g color_b",
]


@pytest.mark.parametrize("names", NAMES)
def test_colours_that_mitsuba_reads(tmp_path: Path, names: str) -> None:
    """What it takes for a colour of vertices, ours is too."""
    lines = ["ply", "format ascii 1.0", "element vertex 3"]
    lines += [f"property float {name}" for name in ("x", "y", "z", *names.split())]
    lines += ["element face 1", "property list uchar int vertex_indices", "end_header"]
    lines += ["0 0 0 0.25 0.5 0.75", "1 0 0 0.25 0.5 0.75", "0 1 0 0.25 0.5 0.75", "3 0 1 2", ""]
    (tmp_path / "mesh.ply").write_text("\n".join(lines))
    mi = mitsuba()
    values = mi.traverse(mi.load_dict({"type": "ply", "filename": str(tmp_path / "mesh.ply")}))
    theirs = next(v for name, v in values if name.startswith("vertex_color"))
    ours = read_mesh(tmp_path / "mesh.ply").colours
    assert ours is not None
    assert np.array_equal(ours.ravel(), np.array(theirs))


def _written(folder: Path, name: str, with_seam: bool) -> Path:
    vertices, faces = uneven_ball()
    faces = faces[[len(set(f)) == 3 for f in faces.tolist()]]
    if name == "mesh.ply":
        trimesh.Trimesh(vertices, faces, process=False).export(folder / name)
        return folder / name
    lines = ["v {!r} {!r} {!r}".format(*v) for v in vertices.tolist()]
    if not with_seam:
        lines += ["f {} {} {}".format(*(f + 1)) for f in faces]
    else:
        # Two halves with texture coordinates of their own, in one file.
        half = vertices[faces].mean(axis=1)[:, 0] > 0.0
        lines += [f"vt {k / 100} {side}" for side in (0, 1) for k in range(len(vertices))]
        offsets = np.where(half, len(vertices), 0)
        for face, offset in zip(faces.tolist(), offsets.tolist(), strict=True):
            lines.append("f " + " ".join(f"{v + 1}/{v + 1 + offset}" for v in face))
    (folder / name).write_text("\n".join(lines) + "\n")
    return folder / name


@pytest.mark.parametrize(
    ("name", "with_seam"), [("mesh.ply", False), ("mesh.obj", False), ("mesh.obj", True)]
)
def test_vertex_normals_are_mitsubas(tmp_path: Path, name: str, with_seam: bool) -> None:
    """Those that it makes of a file without any, along a seam of the texture too."""
    path = _written(tmp_path, name, with_seam)
    mi = mitsuba()
    values = mi.traverse(mi.load_dict({"type": name[-3:], "filename": str(path)}))
    faces = np.array(values["faces"]).reshape(-1, 3)
    theirs = np.array(values["vertex_normals"]).reshape(-1, 3)[faces]
    ours = Mesh(file=str(path), smooth=True).tabulate(TabulationContext()).normals
    assert ours is not None
    corners = np.array(values["vertex_positions"]).reshape(-1, 3)[faces]
    expected = Mesh(file=str(path)).tabulate(TabulationContext()).vertices.reshape(-1, 3, 3)
    assert np.array_equal(corners, expected.astype(np.float32))
    # Edges of 0.2 between points near 1 round by five times u each, and normals with them; angles
    # and six sums round some ten times: below 64 u in all.
    assert np.abs(ours.reshape(-1, 3, 3) - theirs).max() < 64 * UNIT_ROUNDOFF
    if with_seam:
        smooth = Mesh(file=str(_written(tmp_path, "bare.obj", False)), smooth=True)
        bare = smooth.tabulate(TabulationContext()).normals
        assert bare is not None
        assert np.abs(bare - ours).max() > 0.01
