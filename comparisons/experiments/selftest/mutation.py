"""Mutation testing: which seeded changes of the kernels' source does the harness catch?

A mutant counts if it changes a picture of a small scene that runs the changed function.  Then the
rungs without pictures are asked, with few rays and kernels in plain Python (`mutant_worker`), since
that takes seconds.  What they miss is compiled, and compared with the budgets of the smoke suite,
then with those of the standard suite."""

import ast
import copy
import os
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from comparisons.compare.compare import Say
from comparisons.experiments.selftest.fault import PACKAGE, SourceFault, run_patched, run_worker
from comparisons.experiments.selftest.sensitivity import Budgets, compare_patched
from comparisons.results.files import write_json
from comparisons.runs.elsewhere import run_elsewhere
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.files import replacing
from reference_rt.util.workers import Workers

# ---- mutants ------------------------------------------------------------------------------------


FOLDERS = (
    *("accel", "cameras", "core", "integrators", "lights", "materials"),
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


# ---- the harness on mutants ---------------------------------------------------------------------


SCENES = (
    *("cornell_box", "colour_bleeding", "caustic_glass", "soft_shadows", "veach_mis"),
    *("environment", "tilted_lamps", "light_shapes", "light_spot", "light_directional"),
    *("material_blend", "material_bump", "material_conductor", "material_mask"),
    *("material_normal_map", "material_plastic", "material_principled", "material_two_sided"),
    *("material_rough_conductor", "material_rough_conductor_beckmann"),
    *("material_rough_dielectric", "material_rough_plastic", "material_thin_dielectric"),
    *("camera_orthographic", "camera_pinhole", "camera_thin_lens", "camera_view_rectangle"),
    *("filter_lanczos", "filter_mitchell", "filter_tent", "texture_filters", "texture_roughness"),
    *("csg_inside", "csg_nested", "cylinders_and_cones", "quadrics", "polygons_fill_rules"),
    *("phong_spheres", "whitted_classic", "textured_room"),
)
"""Scenes that plain Python renders in seconds: no large mesh, no thousand shapes."""

FILES = ("mutants.json", "mutants.md")

MOST_SCENES = 3
"""Most scenes that a mutant is tried on: the first ones that run the changed function."""

MOST_SECONDS = 600.0
"""Time limit of one process: a mutant may loop."""


WORKER = "comparisons.experiments.selftest.mutant_worker"
PLAIN = {"NUMBA_DISABLE_JIT": "1", "REFERENCE_RT_MITSUBA_VARIANT": "scalar_rgb"}

FEW_RAYS = "few rays"
"""What catches a mutant in plain Python: fewer rays than any suite has."""


@dataclass(frozen=True)
class Fate:
    """What became of a mutant: outcome: "same" (no picture changes), "fails" (the renderer stops
    with an error), "caught" or "survives";  by: FEW_RAYS or the suite that catches it;  rung,
    scene: where it was caught, or the scenes whose pictures changed;  reason: of the rung."""

    file: str
    function: str
    line: int
    what: str
    outcome: str
    by: str
    rung: str
    scene: str
    reason: str

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def mutation(
    count: int, seed: int, scenes: Path, budgets: Budgets, say: Say, workers: Workers
) -> Iterator[Fate]:
    """The fate of `count` mutants of the functions that SCENES run;  budgets: of the suites, the
    small one first."""
    paths = [str((scenes / f"{name}.yaml").resolve()) for name in SCENES]
    say(f"pictures of {len(paths)} scenes")
    right: dict[str, Any] = {}
    runs: dict[Place, list[str]] = {}
    for path, (found, places) in zip(
        paths, run_elsewhere(workers, _right, ((path,) for path in paths)), strict=True
    ):
        right |= found
        for place in places:
            runs.setdefault(place, []).append(path)
    places = [place for place in functions_of(PACKAGE) if place in runs]
    say(f"{len(places)} functions")
    tasks = []
    for mutant in mutants(PACKAGE, places, count, seed):
        some = runs[mutant.file, mutant.function][:MOST_SCENES]
        before = {path: right[path]["picture"] for path in some}
        tasks.append((mutant, before, scenes.resolve(), budgets))
    yield from run_elsewhere(workers, _fate, tasks)


def _right(path: str) -> tuple[dict[str, Any], list[Place]]:
    """The picture of a scene, and the functions of the package that it runs."""
    task = {"scenes": [path], "calls": True, "before": None}
    found = run_worker(WORKER, task, PLAIN, None)
    files = [(Path(file), function) for file, function in found[path].get("functions", ())]
    # Generated code is in no file.
    own = [(file, function) for file, function in files if file.is_relative_to(PACKAGE)]
    return found, [(file.relative_to(PACKAGE).as_posix(), function) for file, function in own]


def _fate(mutant: Mutant, before: dict[str, Any], scenes: Path, budgets: Budgets) -> Fate:
    plain = by_few_rays(mutant, before)
    return _by_suites(mutant, plain, scenes, budgets) if _survives(plain) else plain


def _survives(fate: Fate) -> bool:
    return fate.outcome == "survives"


def summary(fates: Sequence[Fate]) -> str:
    """The share that each suite catches of those that change a picture, and the survivors."""
    left = [fate for fate in fates if _survives(fate)]
    changing = [fate for fate in fates if fate.outcome in ("caught", "survives")]
    lines = [
        f"{len(changing)} of {len(fates)} mutants change a picture; "
        f"{sum(f.outcome == 'same' for f in fates)} change none, "
        f"{sum(f.outcome == 'fails' for f in fates)} stop the renderer",
        *(
            f"{name} catches {_share(sum(f.by in by for f in changing), len(changing))}"
            for name, by in (
                ("few rays", (FEW_RAYS,)),
                ("smoke", (FEW_RAYS, "smoke")),
                ("standard", (FEW_RAYS, "smoke", "standard")),
            )
        ),
    ]
    lines += [f"- {f.file}:{f.line} {f.function}: {f.what} ({f.scene}; {f.reason})" for f in left]
    return "\n".join(lines) + "\n"


def _share(caught: int, n: int) -> str:
    """In words, with its 95 % confidence interval (Clopper and Pearson 1934)."""
    low = float(stats.beta.ppf(0.025, caught, n - caught + 1)) if caught else 0.0
    high = float(stats.beta.ppf(0.975, caught + 1, n - caught)) if caught < n else 1.0
    return f"{caught} of {n} ({low:.0%} to {high:.0%})"


def write(fates: Sequence[Fate], seed: int, out: Path) -> None:
    """Write mutants.json and mutants.md into the folder `out`."""
    document = {"schema": 2, "seed": seed, "mutants": [fate.as_json() for fate in fates]}
    write_json(out / FILES[0], document)
    with replacing(out / FILES[1]) as temporary:
        temporary.write_text(summary(fates), encoding="utf-8")


def by_few_rays(mutant: Mutant, before: Mapping[str, Any]) -> Fate:
    """The fate of a mutant in plain Python;  before: the right pictures, by the scene's path."""

    def fate(outcome: str, by: str = "", rung: str = "", scene: str = "", reason: str = "") -> Fate:
        return Fate(*mutant[:4], outcome, by, rung, scene, reason)

    task = {"scenes": list(before), "calls": False, "before": before}
    try:
        found = run_patched(mutant.file, mutant.text, WORKER, task, MOST_SECONDS, PLAIN)
    except subprocess.TimeoutExpired:
        return fate("fails", reason="takes too long")
    except ReferenceRtError as error:
        return fate("fails", reason=str(error))
    errors = [one["error"] for one in found.values() if "error" in one]
    if errors:
        return fate("fails", reason=errors[0])
    changed = [one for one in found.values() if one["changed"]]
    if not changed:
        return fate("same")
    for one in changed:
        for rung, status, reason in one["rungs"]:
            if status in ("differ", "invalid", "error"):
                return fate("caught", FEW_RAYS, rung, one["scene"], reason)
    said = "; ".join(f"{rung} {status}" for rung, status, _ in changed[0]["rungs"])
    return fate("survives", scene=", ".join(one["scene"] for one in changed), reason=said)


def _by_suites(mutant: Mutant, fate: Fate, scenes: Path, budgets: Budgets) -> Fate:
    """What the suites say, in each scene whose picture changed, to a mutant that few rays miss."""
    said = []
    threads = max(1, (os.cpu_count() or 1) // 2)
    for scene in fate.scene.split(", "):
        fault = SourceFault(mutant.what, scene, mutant.file, "", "")
        of_scene = {suite: by_scene[scene] for suite, by_scene in budgets.items()}
        try:
            found = compare_patched(fault, mutant.text, of_scene, scenes, threads, True)
        except (subprocess.TimeoutExpired, ReferenceRtError) as error:
            reason = str(error)
            return replace(fate, outcome="caught", by="smoke", rung="error", reason=reason[:200])
        if found[-1].caught:
            one = found[-1]
            caught = replace(fate, outcome="caught", by=one.suite, rung=one.rung, scene=scene)
            return replace(caught, reason=one.strength)
        said += [f"{one.suite} {one.verdict}: {one.strength}" for one in found]
    return replace(fate, reason="; ".join(said))
