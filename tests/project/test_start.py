"""What is imported before it is needed: nothing slow; and what `help` prints."""

import ast
import pydoc
import subprocess
import sys
from pathlib import Path

import pytest

import reference_rt

SLOW = (
    *("numpy", "numba", "llvmlite", "pydantic", "rich", "yaml", "PIL", "OpenEXR", "trimesh"),
    *("scipy", "mitsuba", "drjit", "matplotlib", "skimage", "jinja2"),
)
"""Packages that take 0.02 s or more to import."""

INIT = Path(reference_rt.__file__)


def imported_by(code: str) -> list[str]:
    """The slow packages that a fresh interpreter has imported after running the code."""
    code += f"\nimport sys; print(*[name for name in {SLOW} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_importing_the_package_imports_nothing_slow():
    assert imported_by("import reference_rt, comparisons") == []


def test_the_command_line_imports_nothing_slow_before_a_command_is_known():
    code = "from reference_rt.cli import main; main._add_commands()"
    assert imported_by(code) == []
    names = "{c.name or c.callback.__name__ for c in main.app.registered_commands}"
    assert imported_by(f"{code}; assert {{'render', 'compare', 'gate'}} <= {names}") == []


def test_a_name_is_imported_when_it_is_used():
    assert "numba" in imported_by("import reference_rt; reference_rt.Sphere")
    assert "numba" in imported_by("from reference_rt import Scene, render, query")
    with pytest.raises(AttributeError, match="no attribute 'Spere'"):
        _ = reference_rt.Spere


def static_names() -> tuple[dict[str, str], list[str]]:
    """What type checkers see: the module of each name, and `__all__`."""
    tree = ast.parse(INIT.read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    found, listed = {}, []
    for node in block.body:
        if isinstance(node, ast.ImportFrom):
            found |= {alias.name: str(node.module) for alias in node.names}
        elif isinstance(node, ast.Assign):
            listed = ast.literal_eval(node.value)
    return found, listed


def test_type_checkers_see_the_names_that_there_are():
    static, listed = static_names()
    modules = dict.fromkeys(reference_rt._SUBMODULES, "reference_rt")
    assert static == reference_rt._MODULES | modules
    assert sorted([*static, "__version__"]) == sorted(listed)
    assert set(listed) <= set(dir(reference_rt))


def test_help_is_short_and_names_everything():
    for name in reference_rt._MODULES:
        getattr(reference_rt, name)
    lines = pydoc.plain(pydoc.render_doc(reference_rt)).splitlines()
    assert len(lines) <= 300
    words = set("".join(c if c.isalnum() or c == "_" else " " for c in "\n".join(lines)).split())
    assert set(reference_rt._MODULES) <= words
    assert set(reference_rt._SUBMODULES) <= words


@pytest.mark.slow
@pytest.mark.parametrize("module", sorted(reference_rt._EXPORTS))
def test_each_module_can_be_the_first(module):
    """An import circle that one order of imports hides would break another program."""
    assert subprocess.run([sys.executable, "-c", f"import {module}"], check=True).returncode == 0
