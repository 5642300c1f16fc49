"""What is imported before it is needed: nothing slow; and what `help` prints."""

import ast
import importlib
import itertools
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

STUB = Path(reference_rt.__file__).with_suffix(".pyi")
PUBLIC: dict[str, list[str]] = {}
for _node in ast.walk(ast.parse(STUB.read_text(encoding="utf-8"))):
    if isinstance(_node, ast.ImportFrom):
        PUBLIC.setdefault(_node.module or "", []).extend(alias.asname for alias in _node.names)


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


def test_own_commands_import_no_others():
    code = "import sys; sys.argv[1:] = ['schema']; from reference_rt.cli import main; main.main()"
    code = (
        f"try:\n    {code}\nfinally:\n    assert not [n for n in sys.modules if 'comparisons' in n]"
    )
    subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)


def test_suites_begin_before_the_statistics_are_imported():
    assert "skimage" not in imported_by("import comparisons.suites.run")


def test_a_name_is_imported_when_it_is_used():
    assert "numba" in imported_by("import reference_rt; reference_rt.Sphere")
    assert "numba" in imported_by("from reference_rt import Scene, render, query")
    with pytest.raises(AttributeError, match="Spere"):
        _ = reference_rt.Spere


def test_every_public_name_is_where_the_stub_says():
    for module, names in PUBLIC.items():
        home = importlib.import_module(f"reference_rt.{module}".rstrip("."))
        assert [getattr(reference_rt, name) for name in names] == [
            getattr(home, name) for name in names
        ]
    assert sorted(itertools.chain(*PUBLIC.values())) == dir(reference_rt)


def test_the_star_gives_every_public_name():
    found: dict[str, object] = {}
    exec("from reference_rt import *", found)
    del found["__builtins__"]
    assert found == {name: getattr(reference_rt, name) for name in dir(reference_rt)}


def test_help_is_short_and_names_everything():
    names = {getattr(reference_rt, name) and name for name in dir(reference_rt)} - {"__version__"}
    lines = pydoc.plain(pydoc.render_doc(reference_rt)).splitlines()
    assert len(lines) <= 300
    words = set("".join(c if c.isalnum() or c == "_" else " " for c in "\n".join(lines)).split())
    assert names <= words


@pytest.mark.slow
@pytest.mark.parametrize("module", sorted(filter(None, PUBLIC)))
def test_each_module_can_be_the_first(module):
    """An import circle that one order of imports hides would break another program."""
    subprocess.run([sys.executable, "-c", f"import reference_rt.{module}"], check=True)
