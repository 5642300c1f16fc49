"""What docstrings, comments and documents name exists: parameters, fields, functions, files."""

import ast
import builtins
import keyword
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]
PACKAGES = ("reference_rt", "comparisons")
FOLDERS = (*PACKAGES, "tests", "docs", "scenes", "examples")
SOURCES = [path for top in FOLDERS for path in sorted((ROOT / top).rglob("*.py"))]
DOCUMENTS = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
WRITTEN = ("*.yaml", "*.jinja", "*.css", "*.js", "*.pyi", "*.toml")
"""Files that are neither Python nor prose, whose words count as code."""

OTHERS = {
    "ACESFilmicToneMapping", "AgXToneMapping", "CineonToneMapping", "Create", "DaskCluster",
    "LinearToneMapping", "MeshStandardMaterial", "NeutralToneMapping", "ParserState",
    "ReinhardToneMapping", "TONEMAPPING_ACES", "TONEMAPPING_KHR_PBR_NEUTRAL",
    "TONEMAPPING_STANDARD", "artifact", "bsdf_dielectric_diamond", "centroid", "decay",
    "escapeData", "escapeProperty", "idiff", "integrator_direct_lum", "nohup", "physical",
    "toneMappingExposure", "useExactSrgbConversions", "use_attribute_docstrings",
}  # fmt: skip
"""Names of other programs that our documents speak of."""

TICKED = re.compile(r"`((?:[A-Za-z_]\w*\.)*[A-Za-z_]\w*)(?:\(\))?`")
NAMED = re.compile(r"\s*([a-z_]\w*(?:, [a-z_]\w*)*)(?: \([^()]*\))?:\s")
"""What a docstring says of parameters or fields begins like this: `name, other (shape): text`."""


def described(docstring: str) -> list[str]:
    """The parameters or fields that a docstring describes, as parts that two spaces separate."""
    paragraphs = re.sub(r"(?<!\n)\n(?!\n)", " ", docstring).split("\n\n")
    parts = (part for text in paragraphs for part in re.split(r";  |\.  ", text))
    return [name for part in parts if (m := NAMED.match(part)) for name in m.group(1).split(", ")]


def names_in(node: ast.AST) -> set[str]:
    """All names that the code below a node has, strings of one word too."""
    found = set()
    for inner in ast.walk(node):
        match inner:
            case ast.arg(arg=name) | ast.Name(id=name) | ast.Attribute(attr=name):
                found.add(name)
            case ast.Constant(value=str(name)):
                found.add(name)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
    return found


def documented(tree: ast.AST) -> Iterator[tuple[ast.FunctionDef | ast.ClassDef, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            text = ast.get_docstring(node)
            if text is not None:
                yield node, text


def stale_in(source: str) -> list[str]:
    """Names that docstrings describe and that their function or class does not have."""
    return [
        f"{node.name}: {name}"
        for node, text in documented(ast.parse(source))
        if (said := set(described(text)))
        for name in sorted(said - names_in(node))
    ]


def test_described_parameters_and_fields_exist():
    stale = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in SOURCES
        if path.relative_to(ROOT).parts[0] in PACKAGES
        for name in stale_in(path.read_text(encoding="utf-8"))
    ]
    assert stale == []


def test_a_stale_name_is_seen():
    text = '''
def f(rays, hits):
    """What they meet.  rays (n, 3): the input;  hits: the output;  layers, depth: gone."""
class C:
    """A pair.

    first: of two;  second (n,): the other one."""

    first: int
'''
    assert stale_in(text) == ["f: depth", "f: layers", "C: second"]


PROSE = re.compile(r'"""[\s\S]*?"""|#[^\n]*')
CLASS = re.compile(r"^class (\w+)(?:\(([^)]*)\))?:\n((?:(?: .*)?\n)*)", re.MULTILINE)
"""A class at the top of a file: its name, its bases, what is indented below it."""

BASES: dict[str, set[str]] = {}
"""The bases of each class of ours, which `words` fills."""


@cache
def words() -> tuple[frozenset[str], dict[Path, str], dict[str, set[str]]]:
    """The words of all code, the prose of each file, and the names below each class."""
    code = {*dir(builtins), *keyword.kwlist, *OTHERS}
    prose, classes = {}, {}
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        prose[path] = "\n".join(PROSE.findall(text))
        code |= set(re.findall(r"\w+", PROSE.sub("", text)))
        for node in CLASS.finditer(text):
            name, bases, body = node.groups()
            BASES.setdefault(name, set()).update(re.findall(r"\w+", bases or ""))
            inside = re.findall(r"\w+", PROSE.sub("", body))
            classes.setdefault(name, set()).update(inside)
    for path in (p for top in (*FOLDERS, ".github") for p in (ROOT / top).rglob("*.*")):
        code |= {path.stem, *path.relative_to(ROOT).parts}
        if any(path.match(pattern) for pattern in WRITTEN):
            code |= set(re.findall(r"\w+", path.read_text(encoding="utf-8", errors="replace")))
    code |= {path.name for path in ROOT.iterdir()}
    for path in DOCUMENTS:
        prose[path] = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return frozenset(code), prose, classes


def is_known(name: str) -> bool:
    """Whether code has every part of a dotted name: after a module, that module; after a class of
    ours, that class or one of its bases."""
    code, _, classes = words()
    *owners, last = name.split(".")
    if owners and owners[0] in PACKAGES:
        return is_in_module(name)
    owner = owners[-1] if owners else ""
    return all(part in code for part in (*owners, last)) and (
        owner not in classes or last in attributes(owner)
    )


def is_in_module(name: str) -> bool:
    """Whether a full name is a group of entry points, or can be imported, or the module that it
    begins with has the words that follow."""
    if f'"{name}"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8"):
        return True
    first, *rest = name.split(".")
    found = import_module(first)
    while rest:
        with suppress(ModuleNotFoundError):
            import_module(f"{found.__name__}.{rest[0]}")
        if not isinstance(getattr(found, rest[0], None), ModuleType):
            break
        found, rest = getattr(found, rest[0]), rest[1:]
    text = Path(str(found.__file__)).read_text(encoding="utf-8")
    inside = {*dir(found), *re.findall(r"\w+", PROSE.sub("", text))}
    return set(rest[:1]) <= inside and set(rest[1:]) <= words()[0]


def attributes(name: str) -> set[str]:
    """The words of a class of ours and of its bases that are ours."""
    _, _, classes = words()
    seen, waiting = set(), {name}
    while waiting:
        seen |= waiting
        named = set().union(*(BASES.get(one, set()) for one in waiting))
        waiting = named & classes.keys() - seen
    return {"model_fields", "model_copy"}.union(*(classes[one] for one in seen))


def test_names_between_backticks_exist():
    _, prose, _ = words()
    unknown = [
        f"{path.relative_to(ROOT)}: {name}"
        for path, text in prose.items()
        for name in sorted(set(TICKED.findall(text)))
        if not is_known(name)
    ]
    assert unknown == []
