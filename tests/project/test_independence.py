"""reference_rt stands alone: no Mitsuba, no Dr.Jit, nothing of the comparisons."""

import ast
import subprocess
import sys
from pathlib import Path

import reference_rt

PACKAGE = Path(reference_rt.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
FOREIGN = {"mitsuba", "drjit", "comparisons"}
ALLOWED = {
    *("numpy", "numba", "llvmlite", "lazy_loader", "pydantic", "yaml", "OpenEXR", "Imath", "PIL"),
    *(
        "trimesh",
        "DracoPy",
        "meshopt",
        "mapbox_earcut",
        "typer",
        "rich",
        "platformdirs",
        "reference_rt",
    ),
    *sys.stdlib_module_names,
}


def imports(source):
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{source}: imports are absolute"
            yield node.module.partition(".")[0]


def test_imports():
    foreign = {str(path.relative_to(PACKAGE)): set(imports(path)) - ALLOWED for path in SOURCES}
    assert {path: names for path, names in foreign.items() if names} == {}


def test_importing_everything_loads_nothing_foreign():
    modules = [
        ".".join(("reference_rt", *s.relative_to(PACKAGE).with_suffix("").parts)) for s in SOURCES
    ]
    names = ", ".join(m.removesuffix(".__init__") for m in modules)
    code = f"import sys, {names}; print(*sorted({FOREIGN} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
