"""The comparison of a faulty renderer: `compare_scene` without work after the first difference."""

from dataclasses import replace

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, gather
from comparisons.compare.judge import judge
from comparisons.results.case import COMPARED, Case

OF_PICTURES = ("statistics", "images")
"""Rungs that need pictures, which take most of the time."""


def compared(subject: Subject, budget: Budget, threads: int | None = None) -> Case:
    """The case; where a rung without pictures finds a difference, without pictures.  Raises as
    `compare_scene` does."""
    others = tuple(name for name in COMPARED if name not in OF_PICTURES)
    evidence = gather(subject, budget, _silent, threads, others)
    if all(rung.status not in ("differ", "not-comparable") for rung in evidence.rungs):
        of_pictures = gather(subject, budget, _silent, threads, OF_PICTURES)
        evidence = replace(of_pictures, rungs=(*evidence.rungs, *of_pictures.rungs))
    return judge(evidence, budget.limit)


def _silent(step: str) -> None:
    pass
