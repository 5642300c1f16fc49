"""Plants faults and compares the faulty renderer with each suite's budgets."""

import os
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, gather
from comparisons.compare.judge import Evidence, judge, of_replicates
from comparisons.experiments.selftest.fault import (
    PACKAGE,
    Fault,
    Finding,
    PictureFault,
    SceneFault,
    SourceFault,
    compared,
    finding,
    run_patched,
)
from comparisons.results.case import Case
from comparisons.runs.elsewhere import run_elsewhere
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.workers import Workers

Budgets = Mapping[str, Mapping[str, Budget]]
"""Budgets by suite and scene."""

MOST_SECONDS = 900.0
"""Time limit of one patched renderer, which compiles its kernels."""


class StaleFaultError(ReferenceRtError):
    """The text that a fault replaces does not occur exactly once in the source."""


def sensitivity(
    faults: Sequence[Fault], budgets: Budgets, scenes: Path, workers: Workers
) -> Iterator[Finding]:
    """The finding of each suite for each fault, as they are made."""
    right = {}
    for fault in faults:
        for suite, by_scene in budgets.items():
            budget = by_scene[fault.scene]
            if isinstance(fault, PictureFault):
                key = (suite, fault.scene)
                if key not in right:
                    scene = Scene.load(scenes / f"{fault.scene}.yaml")
                    right[key] = gather(Subject(scene), budget, _silent)
                yield finding(fault, suite, _altered(right[key], fault, budget))
            elif isinstance(fault, SceneFault):
                scene = Scene.load(scenes / f"{fault.scene}.yaml")
                subject = Subject(fault.change(scene), scene)
                yield finding(fault, suite, compared(subject, budget))
    sources = [fault for fault in faults if isinstance(fault, SourceFault)]
    threads = max(1, (os.cpu_count() or 1) // workers.threads)
    tasks = [
        (fault, {s: b[fault.scene] for s, b in budgets.items()}, scenes.resolve(), threads)
        for fault in sources
    ]
    for found in run_elsewhere(workers, _patched, tasks):
        yield from found


def _silent(step: str) -> None:
    pass


def _altered(evidence: Evidence, fault: PictureFault, budget: Budget) -> Case:
    rendered = evidence.rendered
    assert rendered is not None
    assert rendered.resampled is not None
    ours, reference = rendered.resampled
    with np.errstate(all="ignore"):
        altered = of_replicates(fault.change(ours), reference, rendered.seconds)
    return judge(replace(evidence, rendered=altered), budget.limit)


def patched_text(fault: SourceFault) -> str:
    """The patched source.  Raises StaleFaultError."""
    text = (PACKAGE / fault.file).read_text(encoding="utf-8")
    if text.count(fault.old) != 1:
        raise StaleFaultError(
            f"selftest: '{fault.name}': the text that it replaces occurs {text.count(fault.old)} "
            f"times in {fault.file}; expected once"
        )
    return text.replace(fault.old, fault.new)


def _patched(
    fault: SourceFault, budgets: Mapping[str, Budget], scenes: Path, threads: int
) -> list[Finding]:
    """Compare a patched copy of the renderer with Mitsuba, in its own process."""
    try:
        return compare_patched(fault, patched_text(fault), budgets, scenes, threads)
    except subprocess.TimeoutExpired:
        why = f"it took more than {MOST_SECONDS:.0f} s"
    except ReferenceRtError as error:
        why = str(error)
    raise ReferenceRtError(f"selftest: '{fault.name}' could not be compared: {why}")


def compare_patched(
    fault: SourceFault,
    text: str,
    budgets: Mapping[str, Budget],
    scenes: Path,
    threads: int,
    until_caught: bool = False,
) -> list[Finding]:
    """The findings of the suites where the fault's file has `text`, in their order;  until_caught:
    leave out the suites after the first that catches it.  Raises as `run_patched`."""
    task = {
        "fault": asdict(fault),
        "scenes": str(scenes.resolve()),
        "budgets": {suite: budget.model_dump() for suite, budget in budgets.items()},
        "threads": threads,
        "until_caught": until_caught,
    }
    worker = "comparisons.experiments.selftest.source_worker"
    answer = run_patched(fault.file, text, worker, task, MOST_SECONDS)
    return [Finding(**fields) for fields in answer]
