"""What Mitsuba and Cycles render is made of descriptions and other readers than ours."""

import ast
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import SCENES

import comparisons
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

NOT_OURS = ("affine", "TABLE", "table")
"""What else has functions of these names: maps of the comparison, tables of Mitsuba's plugins."""

EXCEPTIONS = {
    "geometry/affine.py": {"core.transform"},  # the types of steps
    "translator/moved.py": {"tabulate", "core.transform"},  # our side's vertices; types of steps
    # Digits beyond float32's, where Mitsuba's reader says the same.
    "lights/environment_map.py": {"read_image", "core.transform"},  # what ours takes for a rotation
    "lights/goniometric.py": {"read"},  # refuses a wrong file; the numbers are the second reader's
    "textures/bitmap.py": {"read"},
    "materials/both_sides.py": {"tabulate"},  # our side
    "referee/sizes.py": {"tabulate"},  # sizes, of which bounds of errors are made
}

FOLDERS = (
    "geometry",
    "textures",
    "materials",
    "cameras",
    "lights",
    "shapes",
    "referee",
    "translator",
    "cycles",
    "povray",
)

OTHER_WAY = {
    "reading",
    "reading_meshes",
    "reference",
    "elements",
    "resolved",
    "writing",
    "equal_area",
}
"""Files of these folders that Mitsuba's pictures are not made of: what reads its scenes, and what
writes scenes for others."""

PACKAGE = Path(comparisons.__path__[0])
SOURCES = [
    path
    for folder in FOLDERS
    for path in sorted((PACKAGE / folder).rglob("*.py"))
    if path.stem not in OTHER_WAY
]


def _place(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def _names(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") not in NOT_OURS:
            found |= {node.attr, f"{getattr(node.value, 'id', '')}.{node.attr}"}
        elif isinstance(node, ast.ImportFrom):
            full = [f"{node.module}.{alias.name}" for alias in node.names]
            found |= {alias.name for alias in node.names}
            found |= {"core.transform" for name in full if ".core.transform" in name}
    return found & (OURS | DERIVED)


@pytest.mark.parametrize("path", SOURCES, ids=_place)
def test_no_table_and_no_reader_of_ours(path: Path) -> None:
    assert _names(path) <= EXCEPTIONS.get(_place(path), set())


@pytest.mark.parametrize("name", ["description", "gltf"])
def test_second_readers_of_scene_files_import_nothing_of_ours(name: str) -> None:
    """Nor do they get defaults from our types: `documented.toml` is held against the page alone."""
    text = (PACKAGE / f"rungs/files/{name}.py").read_text(encoding="utf-8")
    modules = [
        module
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for module in [getattr(node, "module", None), *(alias.name for alias in node.names)]
    ]
    assert not [module for module in modules if str(module).startswith("reference_rt")]
    assert not {"__pydantic_fields__", "model_fields", "get_default"} & {
        node.attr for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Attribute)
    }


def test_exceptions_are_needed() -> None:
    by_name = {_place(path): _names(path) for path in SOURCES}
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
