"""What Mitsuba and Cycles render is made of descriptions and other readers than ours."""

import ast
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import SCENES

import comparisons.cycles
import comparisons.geometry
import comparisons.translator
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, gather
from reference_rt.core import transform
from reference_rt.rendering.scene import Scene
from reference_rt.shapes.meshes import mesh as meshes

OURS = {"tabulate", "map_in", "tables", "read_mesh", "read_image", "read", "core.transform"}
"""Names of our tables, readers and maps."""

DERIVED = {f"camera.{name}" for name in ("basis", "rectangle", "angle", "focus")}
DERIVED |= {"uv.coefficients"}
"""What our cameras and textures make of their fields."""

EXCEPTIONS = {
    "affine.py": {"core.transform"},  # the types of steps
    "moved.py": {"tabulate", "core.transform"},  # our side's vertices; the types of steps
    "lights.py": {"read_image"},  # digits beyond float32's, where Mitsuba's reader says the same
    "textures.py": {"read"},  # the same
    "translate.py": {"read"},  # the same
    "sizes.py": {"tabulate"},  # sizes, of which bounds of errors are made
}

FOLDERS = (comparisons.translator, comparisons.cycles, comparisons.geometry)
SOURCES = [path for f in FOLDERS for path in sorted(Path(f.__path__[0]).rglob("*.py"))]


def _names(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") != "affine":
            found |= {node.attr, f"{getattr(node.value, 'id', '')}.{node.attr}"}
        elif isinstance(node, ast.ImportFrom):
            full = [f"{node.module}.{alias.name}" for alias in node.names]
            found |= {alias.name for alias in node.names}
            found |= {"core.transform" for name in full if ".core.transform" in name}
    return found & (OURS | DERIVED)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_no_table_and_no_reader_of_ours(path: Path) -> None:
    assert _names(path) <= EXCEPTIONS.get(path.name, set())


def test_exceptions_are_needed() -> None:
    by_name = {path.name: _names(path) for path in SOURCES}
    assert {name: by_name[name] for name in EXCEPTIONS} == EXCEPTIONS


FAULTS: dict[str, tuple[str, Any, str, Any]] = {
    "meshes too large": (
        "mesh_knot", meshes, "read_mesh",
        lambda data: dataclasses.replace(data, vertices=1.05 * data.vertices),
    ),
    "rotations backwards": ("transforms", transform, "rotate", transform.invert),
    "left for right": (
        "cornell_box", transform, "look_at", lambda m: m * np.array([-1.0, 1.0, 1.0, 1.0]),
    ),
}  # fmt: skip
"""(scene, owner and name of a function of ours, what is done to its result)"""


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_ours_are_not_in_what_mitsuba_renders(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the rung `files`: the rays tell."""
    which, owner, function, change = FAULTS[name]
    right = getattr(owner, function)
    monkeypatch.setattr(owner, function, lambda *given: change(right(*given)))
    scene = Scene.load(SCENES / f"{which}.yaml")
    subject = Subject(scene)
    case = gather(
        subject, Budget(pixels=40, replicates=2, spp=1), lambda step: None, 1, ("geometry",)
    )
    (found,) = [rung for rung in case.rungs if rung.name == "geometry"]
    assert found.status == "differ", found.reason
