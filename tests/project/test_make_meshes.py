"""The script in `scenes` gives the meshes that lie beside it, and they are what they should be."""

import runpy
from pathlib import Path

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
