"""Compares and judges one scene of truth where both sides have the same mistake: run as a program.

Standard input, a JSON object.  planted: by a module's name, pairs of texts, of which the second
replaces the first, which occurs once in its source;  case: of truth;  scenes: its folder;  shown:
the path of another scene, or null;  witness: other renderers' names, or null;  threads.  Standard
output: what `answer` returns.

The sources are changed as they are imported, so nothing of ours is imported before.
"""

import importlib.abc
import importlib.machinery
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

Planted = Mapping[str, Sequence[tuple[str, str]]]


class _Loader(importlib.machinery.SourceFileLoader):
    def __init__(self, name: str, path: str, pairs: Sequence[tuple[str, str]]) -> None:
        super().__init__(name, path)
        self.pairs = pairs

    def get_code(self, fullname: str) -> CodeType:
        """Of the changed source, never from or for Python's own cache."""
        text = Path(self.path).read_text(encoding="utf-8")
        for old, new in self.pairs:
            if text.count(old) != 1:
                raise ImportError(f"{fullname}: '{old}' occurs {text.count(old)} times")
            text = text.replace(old, new)
        code: CodeType = self.source_to_code(text.encode(), self.path)
        return code


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, planted: Planted) -> None:
        self.planted = planted

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name not in self.planted:
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        if spec is not None and spec.origin is not None:
            spec.loader = _Loader(name, spec.origin, self.planted[name])
        return spec


def plant(planted: Planted) -> None:
    """Have modules that are not yet imported changed when they are."""
    assert not set(planted) & set(sys.modules)
    sys.meta_path.insert(0, _Finder(planted))


def answer(task: Mapping[str, Any]) -> dict[str, Any]:
    """What the rungs say, of the case's scene and then of the other one, what truth says, and our
    picture."""
    from comparisons import rungs as ladder
    from comparisons.compare.compare import Subject, compare_scene
    from comparisons.experiments.selftest.mirrored import BUDGET
    from comparisons.renderers import several
    from comparisons.results.rungs import COMPARED
    from comparisons.truth.case import cases
    from comparisons.truth.judge import judge
    from comparisons.truth.renderers import load, ours

    scene = load(Path(task["scenes"]) / f"{task['case']}.yaml")
    pictures = ours(scene, threads=task["threads"])
    truth = judge(cases()[task["case"]].compute(), pictures)
    budget = BUDGET.model_copy(update={"witness": several(task["witness"])})
    # These are asked apart: above a rung that differs the two sides are not compared.
    apart = ("files", "solids")
    rest = tuple(name for name in COMPARED if name not in apart)
    found, verdicts = [], []
    for subject in (scene, *([load(Path(task["shown"]))] if task["shown"] else [])):
        case = compare_scene(Subject(subject), budget, lambda step: None, task["threads"], rest)
        found += [ladder.files(subject), ladder.solids(subject, budget.pixels), *case.rungs]
        verdicts.append(case.verdict)
    return {
        "rungs": [(rung.name, rung.status, rung.reason) for rung in found],
        "verdict": "differ" if "differ" in verdicts else verdicts[0],
        "truth": truth.verdict,
        "percent": truth.percent,
        "reason": truth.reason,
        "picture": pictures[0].ravel().tolist(),
    }


def main() -> None:
    task = json.load(sys.stdin)
    plant(task["planted"])
    json.dump(answer(task), sys.stdout)


if __name__ == "__main__":
    main()
