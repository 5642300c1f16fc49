"""reference_rt stands alone: no Mitsuba, no Dr.Jit, nothing of the comparisons."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import reference_rt
from reference_rt import textbook

PACKAGE = Path(reference_rt.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
FOREIGN = {"mitsuba", "drjit", "comparisons"}
ALLOWED = {
    *(
        "numpy",
        "numba",
        "llvmlite",
        "lazy_loader",
        "pydantic",
        "yaml",
        "OpenEXR",
        "Imath",
        "PIL",
        "trimesh",
    ),
    *("typer", "rich", "platformdirs", "reference_rt"),
    *sys.stdlib_module_names,
}


def imports(source):
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{source}: imports are absolute"
            yield node.module.partition(".")[0]


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: s.relative_to(PACKAGE).as_posix())
def test_imports(source):
    assert set(imports(source)) <= ALLOWED


def test_importing_everything_loads_nothing_foreign():
    modules = [
        ".".join(("reference_rt", *s.relative_to(PACKAGE).with_suffix("").parts)) for s in SOURCES
    ]
    names = ", ".join(m.removesuffix(".__init__") for m in modules)
    code = f"import sys, {names}; print(*sorted({FOREIGN} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_public_names_exist():
    names = [name for name in dir(reference_rt) if not name.startswith("_")]
    assert {"Scene", "Sphere", "render", "query", "textbook", "transform"} <= set(names)
    for name in names:
        assert hasattr(reference_rt, name)


def test_former_names_of_modules_work():
    """Scripts that import the documented modules of earlier versions."""
    from reference_rt import query, transform
    from reference_rt.core import transform as core_transform
    from reference_rt.rendering import query as rendering_query

    assert all(getattr(query, name) is getattr(rendering_query, name) for name in query.__all__)
    assert transform.affine is core_transform.affine
    sys.modules.pop("reference_rt.methods", None)
    with pytest.warns(DeprecationWarning, match=r"is now reference_rt\.textbook"):
        methods = importlib.import_module("reference_rt.methods")
    assert methods.METHODS is textbook.METHODS
