"""Versions of Mitsuba against each other: which of our scenes changed their picture, by how much,
and since which version.

Each version has an environment of its own, and renders the same XML files there, of scenes that
need none of our plugins.  The same seed has the same random numbers in most versions, so that small
changes are seen.
"""

import json
import os
import re
import subprocess
import sys
import venv
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import budgeted
from comparisons.gate.pair import Asked, pair_case
from comparisons.gate.pictures_in import from_array
from comparisons.geometry.flatten import copies_of
from comparisons.mitsuba.backend import LLVM, SCALAR, Backend, cache_folder
from comparisons.mitsuba.llvm_libraries import LIBRARY
from comparisons.report.table import Column, Table
from comparisons.results.case import Case, RungResult, decide
from comparisons.results.headline import headline
from comparisons.translator import MOST_INSTANCES
from comparisons.translator.writing import write_xml
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError, SceneError, UsageError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

Say = Callable[[str], None]


@dataclass(frozen=True)
class Rendered:
    """Of one version: its name, the pictures (replicates, height, width, 3) by scene, and why there
    are none."""

    version: str
    pictures: Mapping[str, FloatArray] = field(default_factory=dict)
    problems: Mapping[str, str] = field(default_factory=dict)


def compared(
    versions: Sequence[str],
    scenes: Sequence[Path],
    budget: Budget,
    backend: Backend,
    say: Say,
) -> tuple[list[Case], list[str]]:
    """A case for each scene and each version but the first, against the one before; and why scenes
    are left out.  backend: the variant, and the version that is installed here.  Raises
    ReferenceUnavailableError, UsageError."""
    for version in versions:
        if not re.fullmatch(r"\d+(\.\d+)+", version):
            raise UsageError(f"'{version}' is no version; expected numbers such as 3.8.0")
    programs = [interpreter(version, backend, say) for version in versions]
    with temporary_folder() as folder:
        names, left_out = _written(scenes, folder, budget, say)
        rendered = [
            _rendered(version, program, names, folder, budget, backend, say)
            for version, program in zip(versions, programs, strict=True)
        ]
    cases = [_case(name, *pair, budget.limit) for name in names for pair in pairwise(rendered)]
    return cases, left_out


def interpreter(version: str, backend: Backend, say: Say) -> str:
    """The Python of an environment with this version of Mitsuba, which is made where there is none
    in the cache.  Raises ReferenceUnavailableError where pip cannot install it."""
    if version == backend.version:
        return sys.executable
    place = cache_folder() / "mitsuba_versions" / f"{version}-py{sys.version_info[1]}"
    program = place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    done = place / "installed"
    if not done.exists():
        say(f"installs Mitsuba {version}")
        venv.create(place, with_pip=True, clear=True)
        run = subprocess.run(
            [str(program), "-m", "pip", "install", "--quiet", f"mitsuba=={version}", "numpy"],
            capture_output=True,
            text=True,
            check=False,
            env=_plain_environment(),
            **tied(),
        )
        if run.returncode:
            why = run.stderr.strip().splitlines()[-1:] or ["it said nothing"]
            raise ReferenceUnavailableError(f"Mitsuba {version} cannot be installed: {why[0]}")
        done.touch()
    return str(program)


def _written(
    scenes: Sequence[Path], folder: Path, budget: Budget, say: Say
) -> tuple[list[str], list[str]]:
    """Write the scenes for Mitsuba: the names of those that need none of our plugins, and why
    others are left out."""
    names, left_out = [], []
    for path in scenes:
        try:
            scene = budgeted(Scene.load(path), budget)
            if sum(copy.instance >= 0 for copy in copies_of(scene)) > MOST_INSTANCES:
                left_out.append(f"{path.stem}: Mitsuba takes minutes to compile many instances")
                continue
            _, notes = write_xml(scene, folder / f"{path.stem}.xml")
        except SceneError as error:
            left_out.append(str(error))
            continue
        ours = [note for note in notes if " is ours: " in note]
        if ours:
            left_out.append(f"{path.stem}: {ours[0].partition(':')[0]}")
        else:
            names.append(path.stem)
    say(f"{len(names)} scenes are written, {len(left_out)} left out")
    return names, left_out


def _rendered(
    version: str,
    program: str,
    names: Sequence[str],
    folder: Path,
    budget: Budget,
    backend: Backend,
    say: Say,
) -> Rendered:
    """The pictures of all scenes by one version; a scene that crashes it ends no other."""
    variant = LLVM if backend.llvm_path else SCALAR
    more = {LIBRARY: backend.llvm_path} if backend.llvm_path else {}
    environment = _plain_environment() | more
    script = str(Path(__file__).with_name("render_xml.py"))
    problems: dict[str, str] = {}
    left = list(names)
    said = ""
    while left:
        say(f"Mitsuba {version}: {len(left)} scenes")
        (folder / "told.jsonl").unlink(missing_ok=True)
        numbers = [str(budget.replicates), str(budget.spp)]
        run = subprocess.run(
            [program, "-P", script, variant, str(folder), *numbers, *left],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            **tied(),
        )
        said = (run.stderr.strip().splitlines() or ["it said nothing"])[-1]
        told = dict(_told(folder / "told.jsonl"))
        problems |= told
        if not told:
            raise ReferenceUnavailableError(f"Mitsuba {version} does not start: {said}")
        left = [name for name in left if name not in told]
    pictures = {n: np.load(folder / f"{n}.npy") for n in names if not problems[n]}
    for name in pictures:
        (folder / f"{name}.npy").unlink()
    return Rendered(version, pictures, {n: p for n, p in problems.items() if p})


def _plain_environment() -> dict[str, str]:
    """This process's, without what leads another Python to the packages of this one."""
    return {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}


def _told(path: Path) -> Iterator[tuple[str, str]]:
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            name, problem = json.loads(line)
            yield name, problem


def _case(name: str, old: Rendered, new: Rendered, limit: float) -> Case:
    """What changed from one version to the next: the candidate is the new one's picture."""
    title = f"{name}: {old.version} to {new.version}"
    sides = f"Mitsuba {new.version}'s", f"Mitsuba {old.version}'s"
    if name in old.pictures and name in new.pictures:
        asked = Asked(limit, title, sides=sides)
        after, before = (from_array(v.pictures[name]) for v in (new, old))
        return pair_case(after, before, asked)
    why = [f"{v.version}: {v.problems[name]}" for v in (old, new) if name in v.problems]
    rung = RungResult("statistics", "not-comparable", "; ".join(why))
    verdict, reason = decide([rung], None)
    return Case(title, verdict, reason, (rung,), None, {}, sides=sides)


def changed(cases: Sequence[Case]) -> list[Case]:
    """Those whose picture changed, or that only one of the versions renders."""
    return [case for case in cases if case.verdict not in ("agree", "inconclusive", "unchanged")]


def table(cases: Sequence[Case]) -> Table[Case]:
    """A row for each change."""
    columns: tuple[Column[Case], ...] = (
        Column("scene", lambda case: case.scene.partition(": ")[0]),
        Column("changed", lambda case: f"from {case.scene.partition(': ')[2]}"),
        Column("bias of the image mean (R, G, B)", _bias),
        Column("what", lambda case: headline(case) if case.cause is None else case.cause.name),
    )
    return Table(columns, changed(cases))


def _bias(case: Case) -> str:
    if case.metrics is None:
        return ""
    return ", ".join(f"{100.0 * bias:+.2g}" for bias in case.metrics.mean_bias) + " %"
