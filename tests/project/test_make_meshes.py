"""The script in `scenes` gives the meshes that lie beside it, and they are what they should be."""

import runpy
from pathlib import Path

import numpy as np

from reference_rt.shapes.meshes.files import read_mesh

SCENES = Path(__file__).parents[2] / "scenes"


def test_knot_is_what_the_script_writes() -> None:
    script = runpy.run_path(str(SCENES / "make_meshes.py"))
    text = script["obj"](*script["torus_knot"](2, 3, around=24, along=440, tube=0.22))
    assert (SCENES / "meshes" / "knot.obj").read_text() == text


def test_petal_is_what_the_script_writes() -> None:
    script = runpy.run_path(str(SCENES / "make_meshes.py"))
    assert (SCENES / "meshes" / "petal.ply").read_text() == script["ply"](*script["petal"](24))
    mesh = read_mesh(SCENES / "meshes" / "petal.ply")
    assert mesh.uv is not None
    assert mesh.colours is not None
    assert mesh.normals is None
    assert len(mesh.faces) == 2 * 24 * 24


def test_knot_is_closed_and_outward() -> None:
    mesh = read_mesh(SCENES / "meshes" / "knot.obj")
    assert len(mesh.faces) >= 20_000
    edges = np.concatenate([mesh.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    # Closed and oriented: each edge is met once each way.
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert set(map(tuple, edges.tolist())) == set(map(tuple, edges[:, ::-1].tolist()))
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert mesh.normals is not None
    assert np.all(np.sum(normals * mesh.normals[mesh.faces[:, 0]], axis=1) > 0.0)
