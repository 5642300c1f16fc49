"""The layout: folders on floors, no import from a lower floor to a higher one, no import circle."""

import ast
import re
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

FLOORS = {
    "reference_rt": (
        *("util", "jit", "core", "sampling", "textures", "shapes", "cameras", "accel"),
        *("materials", "lights", "media", "integrators", "scene", "gltf", "rendering"),
        *("textbook", "cli"),
    ),
    "comparisons": (
        *("results", "geometry", "statistics", "renderers", "mitsuba", "textures", "materials"),
        *("media", "cameras", "lights", "shapes", "integrators", "referee", "translator"),
        *("pbrt", "gltf"),
        *("runs", "raysect", "cycles", "povray", "rungs", "report", "compare", "gate", "truth"),
        *("suites", "experiments", "commands"),
    ),
}
"""The folders of each package from the lowest to the highest: a file may import files of its own
folder and of folders before it."""

LOOSE = {
    "reference_rt": {"__init__.py", "__main__.py", "query.py", "transform.py"},
    "comparisons": {"__init__.py", "testing.py"},
}
"""Files beside the folders: the package's public face, which imports from any folder."""

LONGEST = 500
"""Lines of a file: one subject that can be read in one sitting."""

SOURCES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in FLOORS
    for path in sorted((ROOT / package).rglob("*.py"))
}
FILES = [*SOURCES.values(), *sorted((ROOT / "tests").rglob("*.py"))]


def imports_of(text: str) -> set[str]:
    """The modules of the project that a source imports, anywhere in it: inside functions and under
    TYPE_CHECKING too."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in SOURCES else str(node.module))
    return found & SOURCES.keys()


@cache  # not at import: every process of tests imports this file
def imports() -> dict[str, set[str]]:
    """The modules of the project that each one imports."""
    return {
        module: imports_of(path.read_text(encoding="utf-8")) - {module}
        for module, path in SOURCES.items()
    }


def floor(module: str) -> int | None:
    """The number of its folder from below; none for the package's own files."""
    package, _, rest = module.partition(".")
    folder = rest.partition(".")[0]
    return FLOORS[package].index(folder) if folder in FLOORS[package] else None


@pytest.mark.parametrize("package", FLOORS)
def test_every_folder_has_its_floor(package):
    folders = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert folders == set(FLOORS[package])
    assert {path.name for path in (ROOT / package).glob("*.py")} == LOOSE[package]


def test_no_import_circle():
    try:
        TopologicalSorter(imports()).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_imports_go_down():
    upwards = [
        f"{module} imports {other}"
        for module, others in imports().items()
        for other in sorted(others)
        if module.partition(".")[0] == other.partition(".")[0]
        and (here := floor(module)) is not None
        and ((there := floor(other)) is None or there > here)
    ]
    assert upwards == []


def test_every_form_of_import_is_seen():
    text = """
def f():
    from reference_rt.core.ray import Ray
    import reference_rt.core.vec3 as vec3
if TYPE_CHECKING:
    from reference_rt.scene import build, model
from reference_rt.shapes import Sphere
import numpy
"""
    core, scene = "reference_rt.core", "reference_rt.scene"
    assert imports_of(text) == {
        *(f"{core}.ray", f"{core}.vec3", f"{scene}.build", f"{scene}.model", "reference_rt.shapes")
    }


def test_files_are_short_and_say_what_they_hold():
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in FILES}
    assert [path for path, text in texts.items() if text.count("\n") > LONGEST] == []
    begin = re.compile(r'(#!.*\n)?r?"""\S')
    assert [path for path, text in texts.items() if not begin.match(text)] == []


def test_tests_mirror_the_packages():
    folders = {p.parent.relative_to(ROOT / "tests") for p in (ROOT / "tests").rglob("test_*.py")}
    mirrored = {Path(package, folder) for package, names in FLOORS.items() for folder in names}
    assert folders <= mirrored | {Path("project")}


def test_the_longest_tests_exist():
    """The names by which `tests/conftest.py` orders files."""
    tree = ast.parse((ROOT / "tests" / "conftest.py").read_text(encoding="utf-8"))
    (names,) = (
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "LONGEST_FIRST"
    )
    files = [path.stem for path in (ROOT / "tests").rglob("test_*.py")]
    assert set(names) <= set(files)
    assert len(set(names)) == len(names)
    assert len(set(files)) == len(files)


def test_contracts_name_what_exists():
    """The names between backticks in the docstrings of packages: files and folders exist, names
    occur in the code of the package, or of a module beside it."""
    missing = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in SOURCES.values()
        if path.name == "__init__.py"
        for name in BACKTICKED.findall(ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "")
        if not exists_for(path.parent, name)
    ]
    assert missing == []


BACKTICKED = re.compile(r"`((?:[\w/]+\.)*[\w/]+)`")


def exists_for(folder: Path, name: str) -> bool:
    """Whether a package in `folder` may speak of `name`: a file, a folder, a module, or a word of
    the code of the module that the name begins with, or of the package itself."""
    places = (folder, folder.parent, ROOT / folder.relative_to(ROOT).parts[0], ROOT)
    if "/" in name or name.endswith(".py"):
        return any((place / name).exists() for place in places)
    if name.startswith("test_"):
        return any((ROOT / "tests").rglob(f"{name}.py"))
    if name.rpartition(".")[2] in ("json", "jinja", "exr"):  # what a program writes
        return True
    parts = name.split(".")
    for n in range(len(parts), 0, -1):
        for place in places:
            inner = place.joinpath(*parts[:n])
            found = [inner.with_suffix(".py")] if inner.with_suffix(".py").exists() else []
            found += inner.rglob("*.py") if inner.is_dir() else []
            if found:
                return any(set(parts[n:]) <= words_in(path) for path in found)
    return any(set(parts) <= words_in(path) for path in folder.rglob("*.py"))


@cache
def words_in(path: Path) -> frozenset[str]:
    """The words of a source without those of its docstring and of comments."""
    code = re.sub(r'\A(#!.*\n)?r?""".*?"""|#[^\n]*', "", path.read_text("utf-8"), flags=re.DOTALL)
    return frozenset(re.findall(r"\w+", code))


def test_files_that_are_named_exist():
    """Sources and documents name files of Python between backticks."""
    texts = [*SOURCES.values(), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")]
    # Not all of ROOT: a newcomer's environment may be in it.
    tops = (*FLOORS, "tests", "docs", "examples", "scenes")
    files = [f"/{file.relative_to(ROOT)}" for top in tops for file in (ROOT / top).rglob("*.py")]
    missing = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in texts
        if path.name != "CHANGELOG.md"
        for name in set(re.findall(r"`((?:\w+/)*\w+\.py)`", path.read_text(encoding="utf-8")))
        if not any(file.endswith(f"/{name}") for file in files)
    ]
    assert missing == ["comparisons/experiments/fuzz/finding.py: renderer.py"]  # a user's
