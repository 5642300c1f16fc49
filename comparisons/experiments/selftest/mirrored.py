"""Mistakes made on both sides at once (`of_mirrored`): who sees them?

Where Mitsuba lacks a feature, its side is code of ours, and a misunderstanding may be in both: they
agree.  A rung with a second source of its own may see it, as may a witness; and a case of truth
must, whose formula shares nothing with either.

Each mistake is planted in a process of its own, in the sources as they are imported.  A mistake in
a kernel compiles kernels of the scene.

POV-Ray does not vote on the pictures of most cases of truth, which have lamps of size or are path
traced: `lectures.yaml` is a scene on which it does.
"""

import ast
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.experiments.selftest.fault import CAUGHT, PACKAGE, run_worker
from comparisons.experiments.selftest.kept_kernels import link_kept
from comparisons.experiments.selftest.of_mirrored import Changes, Mistake
from comparisons.experiments.selftest.sensitivity import MOST_SECONDS
from comparisons.renderers import Witnesses
from comparisons.report.table import Column, Table
from comparisons.results.files import write_json
from comparisons.rungs.geometry import BY_EXACT_ARITHMETIC
from comparisons.runs.elsewhere import run_elsewhere
from comparisons.runs.provenance import provenance
from comparisons.truth.renderers import load, ours
from reference_rt.util.files import replacing, temporary_folder
from reference_rt.util.workers import Workers

FILES = ("mirrored.json", "mirrored.md")

BUDGET = Budget(spp=32, replicates=8, pixels=1024, light_pixels=256)
"""For scenes of truth, which have 32 x 32 pixels."""

LECTURES = Path(__file__).with_name("lectures.yaml")
"""What the lectures draw by Whitted's ray tracing, all of which POV-Ray has."""

WITNESSES = ("files", "solids", "sampling", "exact arithmetic", "witness")
"""Rungs that ask somebody else than our renderer and Mitsuba's side."""

REAL = 1e-3
"""Least change of a pixel, over the picture's mean, that a mistake must make."""


@dataclass(frozen=True)
class Seen:
    """What a mistake on both sides does, in the scene of its case of truth and, with a witness, in
    LECTURES, if what is mistaken is there.

    change: of the pixel of our picture that changes most, over the mean;  alike: the verdict of the
    rungs that compare both sides, which is "differ" where they are not the same mistake;  by: the
    rungs of WITNESSES that see it;  truth, percent: the verdict of its case, and how far the
    picture is off.
    """

    mistake: str
    case: str
    change: float
    alike: str
    by: tuple[str, ...]
    verdict: str
    truth: str
    percent: float
    rungs: tuple[tuple[str, str, str], ...]

    @property
    def holds(self) -> bool:
        """Whether it is a mistake, the same one on both sides, and its case of truth sees it."""
        return self.change > REAL and self.alike not in CAUGHT and self.truth == "off"

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def mirrored(
    mistakes: Sequence[Mistake], scenes: Path, witness: Witnesses, workers: Workers
) -> Iterator[Seen]:
    """What is seen of each mistake, as it is found;  scenes: the folder of truth's scenes."""
    threads = max(1, (os.cpu_count() or 1) // workers.threads)
    tasks = ((mistake, scenes.resolve(), witness, threads) for mistake in mistakes)
    yield from run_elsewhere(workers, seen, tasks)


def seen(mistake: Mistake, scenes: Path, witness: Witnesses, threads: int) -> Seen:
    """Raises ReferenceRtError, subprocess.TimeoutExpired."""
    right = ours(load(scenes / f"{mistake.case}.yaml"), 1, threads)[0]
    task = {
        "planted": {
            **_by_module("reference_rt", mistake.ours),
            **_by_module("comparisons", mistake.theirs),
        },
        "case": mistake.case,
        "scenes": str(scenes),
        "shown": str(LECTURES) if mistake.in_lectures and witness else None,
        "witness": witness,
        "threads": threads,
    }
    worker = str(Path(__file__).with_name("mirrored_worker.py"))
    with temporary_folder() as folder:
        own = {}
        if changes_kernels(mistake.ours):
            link_kept(mistake.ours, folder)
            own["REFERENCE_RT_CACHE"] = str(folder)
        found = run_worker(worker, task, own, MOST_SECONDS)
    change = np.abs(np.reshape(found["picture"], right.shape) - right).max() / right.mean()
    statuses = [
        ("exact arithmetic" if BY_EXACT_ARITHMETIC in reason else name, status)
        for name, status, reason in found["rungs"]
    ]
    told = [status for name, status in statuses if name not in WITNESSES]
    caught = {name for name, status in statuses if status in CAUGHT}
    return Seen(
        mistake.name,
        mistake.case,
        float(change),
        next((status for status in CAUGHT if status in told), "agree"),
        tuple(name for name in WITNESSES if name in caught),
        found["verdict"],
        found["truth"],
        found["percent"],
        tuple(tuple(rung) for rung in found["rungs"]),
    )


def _by_module(package: str, changes: Changes) -> dict[str, Any]:
    return {
        f"{package}.{file.removesuffix('.py').replace('/', '.')}": pairs
        for file, pairs in changes.items()
    }


# ---- sources -------------------------------------------------------------------------------------


FOLDERS = {"ours": PACKAGE, "theirs": Path(__file__).parents[2]}


def texts(folder: Path, changes: Changes) -> Iterator[tuple[str, str, str]]:
    """(file, its source, its source with the changes), each of which fits once.  Raises
    ValueError."""
    for file, pairs in changes.items():
        right = wrong = (folder / file).read_text(encoding="utf-8")
        for old, new in pairs:
            if wrong.count(old) != 1:
                raise ValueError(f"{file}: '{old}' occurs {wrong.count(old)} times; expected once")
            wrong = wrong.replace(old, new)
        yield file, right, wrong


def functions_changed(right: str, wrong: str) -> dict[str, list[str]]:
    """The names of functions that differ between two sources, with their decorators."""
    before, after = (
        {node.name: node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)}
        for text in (right, wrong)
    )
    return {
        name: [ast.unparse(decorator) for decorator in node.decorator_list]
        for name, node in after.items()
        if name not in before or ast.dump(node) != ast.dump(before[name])
    }


def changes_kernels(changes: Changes) -> bool:
    """Whether compiled code of ours is changed, so that no kernel in the cache fits."""
    return any(
        decorators
        for _, right, wrong in texts(PACKAGE, changes)
        for decorators in functions_changed(right, wrong).values()
    )


# ---- the table -----------------------------------------------------------------------------------


def summary(found: Sequence[Seen]) -> str:
    """How many the sides alone call `agree`, and how many with witnesses, and with truth."""
    alone = sum(one.alike == "agree" for one in found)
    missed = [one for one in found if not one.by]
    unseen = [one.mistake for one in missed if one.truth != "off"]
    told = f": {', '.join(unseen)}" if unseen else ""
    return (
        f"of {len(found)} mistakes on both sides {alone} are `agree` between them; other sources "
        f"see {len(found) - len(missed)}, cases of truth {sum(o.truth == 'off' for o in found)}; "
        f"nobody sees {len(unseen)}{told}"
    )


COLUMNS = (
    Column[Seen]("mistake on both sides", lambda one: one.mistake),
    Column[Seen]("between them", lambda one: one.alike),
    Column[Seen]("seen by the rung", lambda one: ", ".join(one.by) or "none"),
    Column[Seen]("seen by the case of truth", lambda one: _truth(one)),
)


def _truth(one: Seen) -> str:
    return f"{one.case}, {one.percent:+.2g} %" if one.truth == "off" else f"**not** {one.case}"


def write(found: Sequence[Seen], out: Path) -> None:
    """Write mirrored.json and mirrored.md into the folder `out`."""
    facts: Mapping[str, Any] = provenance()
    document = {"schema": 1, "provenance": facts, "mistakes": [one.as_json() for one in found]}
    write_json(out / FILES[0], document)
    lines = [*Table(COLUMNS, found).markdown(), "", summary(found)]
    with replacing(out / FILES[1]) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
