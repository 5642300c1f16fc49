"""The page of a run: distinct findings, each with its reduced scene, pictures and command."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from comparisons.experiments.fuzz.coverage import coverage
from comparisons.experiments.fuzz.data import text_of
from comparisons.experiments.fuzz.run import Plan, Run
from comparisons.experiments.fuzz.summary import again, distinct, words
from comparisons.report.templates import template, write


def write_page(path: Path, plan: Plan, run: Run, provenance: Mapping[str, Any]) -> None:
    """Write the page, whole or not at all; all text is escaped."""
    rungs: dict[str, Counter[str]] = {}
    for checked in run.scenes.values():
        for name, status in checked.rungs.items():
            rungs.setdefault(name, Counter())[status] += 1
    findings = [
        {
            "reduced": one,
            "count": count,
            "text": text_of(one.scene) if one.scene else "",
            "again": again(plan, one),
        }
        for one, count in distinct(run)
    ]
    page = template("fuzz.html.jinja", "experiments/fuzz").render(
        lines=words(run),
        findings=findings,
        rungs={name: counts.most_common() for name, counts in rungs.items()},
        coverage=coverage(checked.types for checked in run.scenes.values()),
        provenance={**provenance, "seed": plan.seed},
    )
    write(path, page)
