"""Seeded changes of the kernels' source, one each."""

import ast
import copy
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

FOLDERS = (
    *("accel", "cameras", "core", "integrators", "lights", "materials", "media"),
    *("sampling", "shapes", "textures", "rendering"),
)
"""Folders of the package with kernels."""

KERNELS = ("kernel", "entry_kernel", "operation")
"""Names of the decorators of functions that are compiled."""

SIZE = 1.05
"""Factor of a changed constant: small enough to look plausible."""

Place = tuple[str, str]
"""A file of the package, and the name of a function in it."""


class Mutant(NamedTuple):
    """file: of the package;  function: in it;  line: in the right source;  what: the change in
    words;  text: the whole changed source."""

    file: str
    function: str
    line: int
    what: str
    text: str


_OPERATORS: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.Gt,
    ast.Gt: ast.Lt,
    ast.LtE: ast.Gt,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
_NAMES = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "floor": "ceil"}
_FIELDS = {"x": "y", "y": "z", "z": "x", "u": "v", "v": "u"}


def functions_of(package: Path) -> list[Place]:
    """All kernels of the package, in order."""
    return [(file, function.name) for file, tree in _trees(package) for function in _kernels(tree)]


def mutants(package: Path, places: Sequence[Place], count: int, seed: int) -> list[Mutant]:
    """`count` mutants, each drawn with equal probability from all changes in the functions
    `places`; fewer if there are not so many."""
    wanted = set(places)
    found: list[tuple[str, str, int, int]] = []  # file, function, number of the node, of the change
    trees = dict(_trees(package))
    for file, tree in trees.items():
        for function in _kernels(tree):
            if (file, function.name) in wanted:
                for k, node in enumerate(_nodes(function)):
                    found += [(file, function.name, k, i) for i in range(len(_changes(node)))]
    chosen = np.random.default_rng(seed).permutation(len(found))[:count]
    return [_made(trees, *found[k]) for k in chosen.tolist()]


def _made(trees: Mapping[str, ast.Module], file: str, function: str, node: int, i: int) -> Mutant:
    tree = copy.deepcopy(trees[file])
    (found,) = (f for f in _kernels(tree) if f.name == function)
    place = _nodes(found)[node]
    line, before = place.lineno, ast.unparse(place)  # type: ignore[attr-defined]
    _apply(place, i)
    what = f"{before} -> {ast.unparse(place)}"
    return Mutant(file, function, line, what, ast.unparse(ast.fix_missing_locations(tree)))


def _trees(package: Path) -> Iterator[tuple[str, ast.Module]]:
    for folder in FOLDERS:
        for path in sorted((package / folder).rglob("*.py")):
            yield path.relative_to(package).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def _kernels(tree: ast.Module) -> list[ast.FunctionDef]:
    """Functions with a decorator of KERNELS; of several with one name none."""
    found = [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any(_name(decorator) in KERNELS for decorator in node.decorator_list)
    ]
    names = [function.name for function in found]
    return [function for function in found if names.count(function.name) == 1]


def _name(node: ast.expr) -> str:
    if isinstance(node, ast.Call):
        node = node.func
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


def _nodes(function: ast.FunctionDef) -> list[ast.AST]:
    """The expressions in the body, without annotations and docstrings."""
    return [
        node
        for statement in function.body
        for node in ast.walk(statement)
        if isinstance(node, ast.expr)
    ]


def _changes(node: ast.AST) -> list[str]:
    """What can be changed at a node, in words."""
    if isinstance(node, ast.BinOp):
        return ["operator"] if type(node.op) in _OPERATORS else []
    if isinstance(node, ast.Compare):
        return ["operator"] if type(node.ops[0]) in _OPERATORS else []
    if isinstance(node, ast.BoolOp):
        return ["operator"]
    if isinstance(node, ast.UnaryOp):
        return ["sign"] if isinstance(node.op, ast.USub | ast.Not) else []
    if isinstance(node, ast.Constant):
        return ["constant"] if type(node.value) in (int, float) else []
    if isinstance(node, ast.Attribute):
        of_math = isinstance(node.value, ast.Name) and node.value.id == "math"
        return ["name"] if node.attr in (_NAMES if of_math else _FIELDS) else []
    if isinstance(node, ast.Name):
        return ["name"] if node.id in ("min", "max") else []
    return []


def _apply(node: ast.AST, i: int) -> None:
    """Make change number i of `_changes` in place."""
    match node:
        case ast.BinOp() | ast.BoolOp():
            node.op = _OPERATORS[type(node.op)]()
        case ast.Compare():
            node.ops[0] = _OPERATORS[type(node.ops[0])]()
        case ast.UnaryOp():
            node.op = ast.UAdd() if isinstance(node.op, ast.USub) else ast.USub()
        case ast.Constant():
            value = node.value
            if isinstance(value, int):
                node.value = value + 1 if value >= 0 else value - 1
            elif isinstance(value, float):
                node.value = SIZE * value if value else 0.05
        case ast.Attribute():
            node.attr = _NAMES.get(node.attr) or _FIELDS[node.attr]
        case ast.Name():
            node.id = _NAMES[node.id]
