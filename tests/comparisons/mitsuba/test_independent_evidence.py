"""What Mitsuba renders is made of descriptions and other readers than ours, not of our tables."""

import ast
from pathlib import Path

import pytest

import comparisons.geometry
import comparisons.mitsuba.translate

OURS = {"tabulate", "map_in", "tables", "read_mesh", "read_image", "read", "core.transform"}
"""Names of our tables, readers and maps."""

DERIVED = {f"camera.{name}" for name in ("basis", "rectangle", "angle", "focus")}
DERIVED |= {"uv.coefficients"}
"""What our cameras and textures make of their fields."""

EXCEPTIONS = {
    "affine.py": {"core.transform"},  # the types of steps
    "moved.py": {"tabulate", "core.transform"},  # where a mesh lies chooses the frame; the types
    "lights.py": {"read_image"},  # digits beyond float32's, where Mitsuba's reader says the same
    "textures.py": {"read"},  # the same
    "sizes.py": {"tabulate"},  # sizes, of which bounds of errors are made
}

FOLDERS = (comparisons.mitsuba.translate, comparisons.geometry)
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
