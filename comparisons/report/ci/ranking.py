"""The order of cases where there is not room for all: the worst first."""

from collections.abc import Sequence

from comparisons.results.case import Case, Status
from comparisons.results.rungs import RUNGS

SEVERITY: tuple[Status, ...] = (
    "invalid",
    "differ",
    "inconclusive",
    "not-comparable",
    "reference-limited",
    "not-applicable",
    "agree",
    "unchanged",
)
"""Verdicts, the worst first."""


def ranked(cases: Sequence[Case]) -> list[Case]:
    """Cases ordered by verdict, then by the first rung that breaks, then by name."""
    return sorted(cases, key=lambda c: (SEVERITY.index(c.verdict), _first_rung(c), c.scene))


def _first_rung(case: Case) -> int:
    """The index in RUNGS of the first rung that has the verdict of the case."""
    return min(
        (RUNGS.index(t.name) for t in case.rungs if t.status == case.verdict and t.name in RUNGS),
        default=len(RUNGS),
    )
