"""Planted faults, a small change of a picture, of a scene, or of the renderer's source; what a
suite says to one; and worker processes whose `reference_rt` is a copy with one changed file.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import reference_rt
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, gather
from comparisons.compare.judge import judge
from comparisons.results.case import Case, FloatArray
from comparisons.results.rungs import COMPARED, RUNGS
from comparisons.rungs.limited import limited
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

# ---- without work after the first difference ----------------------------------------------------


OF_PICTURES = ("statistics", "images")
"""Rungs that need pictures, which take most of the time."""


def compared(subject: Subject, budget: Budget, threads: int | None = None) -> Case:
    """The case; where a rung without pictures finds a difference, without pictures.  Raises as
    `compare_scene` does."""
    others = tuple(name for name in COMPARED if name not in OF_PICTURES)
    evidence = gather(subject, budget, _silent, threads, others)
    judged = limited(evidence.rungs)
    if all(rung.status not in ("differ", "not-comparable") for rung in judged):
        of_pictures = gather(subject, budget, _silent, threads, OF_PICTURES)
        evidence = replace(of_pictures, rungs=(*evidence.rungs, *of_pictures.rungs))
    return judge(evidence, budget.limit)


def _silent(step: str) -> None:
    pass


# ---- planted faults -----------------------------------------------------------------------------


@dataclass(frozen=True)
class PictureFault:
    """name: in a few words;  scene: name of the scene;  change: applied to the replicates
    (replicates, height, width, 3) of the correct renderer."""

    name: str
    scene: str
    change: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class SceneFault:
    """change: applied to the scene that we render; Mitsuba renders the original."""

    name: str
    scene: str
    change: Callable[[Scene], Scene]


@dataclass(frozen=True)
class SourceFault:
    """The text `old`, which must occur once in `file` of the package, is replaced by `new`.

    rung: that must see it, where one must: of faults that both renderers would share it is the one
    that has a second source.
    """

    name: str
    scene: str
    file: str
    old: str
    new: str
    rung: str = ""


Fault = PictureFault | SceneFault | SourceFault


# ---- findings -----------------------------------------------------------------------------------


CAUGHT = ("differ", "invalid")


@dataclass(frozen=True)
class Finding:
    """caught: whether the case fails with `differ` or `invalid`, not only with too much noise;
    rung: the first that broke;  strength: how clearly, in that rung's numbers;  cause: the
    diagnosis, or ""."""

    fault: str
    kind: str
    scene: str
    suite: str
    verdict: str
    caught: bool
    rung: str
    strength: str
    cause: str

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def finding(fault: Fault, suite: str, case: Case) -> Finding:
    """The finding from the case with the fault."""
    gravest = "invalid" if case.verdict == "invalid" else "differ"
    by_name = {result.name: result for result in case.rungs}
    rung = next((n for n in RUNGS if n in by_name and by_name[n].status == gravest), "")
    strength = _strength(rung, by_name[rung].numbers, by_name[rung].reason) if rung else case.reason
    kind = {PictureFault: "picture", SceneFault: "scene"}.get(type(fault), "source")
    return Finding(
        fault.name,
        kind,
        fault.scene,
        suite,
        case.verdict,
        case.verdict in CAUGHT,
        rung,
        strength,
        case.cause.name if case.cause else "",
    )


LONGEST = 90
"""Characters of a reason in the table."""


def _strength(rung: str, numbers: dict[str, Any], reason: str) -> str:
    if rung == "direct" and numbers.get("rays"):
        return f"{numbers['unexplained']:,} of {numbers['rays']:,} values"
    if rung == "whitted" and numbers.get("pixels"):
        return f"{numbers['unexplained']:,} of {numbers['pixels']:,} pixels"
    if rung == "film":
        return f"{numbers['max_error_over_bound']:,.0f} times the bound"
    for what_follows in (", beyond", ", though", "; "):
        reason = reason.partition(what_follows)[0]
    return reason if len(reason) <= LONGEST else reason[: LONGEST - 1] + "…"


PACKAGE = Path(reference_rt.__file__).resolve().parent


def run_patched(
    file: str,
    text: str,
    worker: str,
    task: Mapping[str, Any],
    seconds: float,
    environment: Mapping[str, str] | None = None,
) -> Any:
    """What the module `worker` answers to `task`, both JSON, if `file` of the package has `text`.

    Raises subprocess.TimeoutExpired after so many seconds,
    and ReferenceRtError with the last line of the worker's errors if it fails.
    """
    with patched(file, text) as own:
        return run_worker(worker, task, {**(environment or {}), **own}, seconds)


@contextmanager
def patched(file: str, text: str) -> Iterator[dict[str, str]]:
    """The variables of processes whose `reference_rt` is a copy in which `file` has `text`, and
    whose kernel cache is the copy's own."""
    with temporary_folder() as folder:
        package = folder / "reference_rt"
        skipped = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
        shutil.copytree(PACKAGE, package, ignore=skipped)
        (package / file).write_text(text, encoding="utf-8")
        path = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH", ""))))
        yield {"PYTHONPATH": path, "REFERENCE_RT_CACHE": f"{folder}/cache"}


def run_worker(
    worker: str, task: Mapping[str, Any], environment: Mapping[str, str], seconds: float | None
) -> Any:
    """What a module, or a file with a program, answers to `task`, with these variables besides the
    present ones.  Raises as `run_patched`."""
    program = [worker] if worker.endswith(".py") else ["-m", worker]
    run = subprocess.run(
        # -P: do not import from the current folder, which may have a reference_rt.
        [sys.executable, "-P", *program],
        input=json.dumps(task),
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=seconds,
        **tied(),
        check=False,
    )
    if run.returncode != 0:
        lines = [line for line in run.stderr.splitlines() if line.strip()]
        raise ReferenceRtError(lines[-1] if lines else f"exit code {run.returncode}")
    return json.loads(run.stdout)
