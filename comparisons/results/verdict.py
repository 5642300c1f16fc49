"""The verdict of a scene from its rungs, and the exit code of a run from its verdicts."""

from collections.abc import Sequence

from comparisons.results.case import Case, Metrics, RungResult, Status
from comparisons.results.rungs import RUNGS

_FAILURES: tuple[Status, ...] = (
    "invalid",  # makes every other result meaningless
    "differ",
    "inconclusive",
    "not-comparable",  # a rung that applies but could not be run: agreement is not shown
    "reference-limited",
)
"""The statuses that keep a scene from agreeing, gravest first."""

PASSING: tuple[Status, ...] = ("agree", "unchanged", "reference-limited")


def decide(results: Sequence[RungResult], metrics: Metrics | None) -> tuple[Status, str]:
    """The verdict on one scene and the reason, which names the first rung that gives it.

    The gravest status of any rung decides: `invalid` (also by pixels not finite in the pictures),
    `differ`, `inconclusive`, `not-comparable`, `reference-limited`; among rungs of that status the
    first one of RUNGS gives the reason. Otherwise the scene is `unchanged` if a rung is, and agrees
    if at least one rung other than `input` agrees; if none does it is `not-comparable`. Raises
    ValueError for a name not in RUNGS.
    """
    if unknown := {result.name for result in results} - set(RUNGS):
        raise ValueError(f"not a rung: {', '.join(sorted(unknown))}; the rungs are {RUNGS}")
    ladder = sorted(results, key=lambda result: RUNGS.index(result.name))
    pixels = metrics.nonfinite if metrics else 0
    if pixels and not any(result.status == "invalid" for result in ladder):
        return "invalid", f"images: {pixels} pixel{'s' if pixels > 1 else ''} not finite"
    for status in _FAILURES:
        for result in ladder:
            if result.status == status:
                return status, f"{result.name}: {result.reason}{_besides(ladder, status)}"
    for result in ladder:
        if result.status == "unchanged":
            return "unchanged", f"{result.name}: {result.reason}"
    agreed = [result for result in ladder if result.status == "agree"]
    if not any(result.name != "input" for result in agreed):
        return "not-comparable", "no rung applies to this scene"
    rungs = ", ".join(result.name for result in agreed)
    # The statistics' reason states the smallest detectable bias: how much the agreement is worth.
    summary = next((result for result in agreed if result.name == "statistics"), agreed[-1])
    return "agree", f"{rungs}: {summary.reason}"


def _besides(ladder: Sequence[RungResult], verdict: Status) -> str:
    """What else was found in pictures that are invalid: a difference that is certain even so."""
    found = [f"{r.name}: {r.reason}" for r in ladder if r.status == "differ"]
    return f"; besides, {found[0]}" if verdict == "invalid" and found else ""


def exit_code(cases: Sequence[Case], missing: Sequence[str] = ()) -> int:
    """0 if every case passes (with a verdict of PASSING), otherwise the highest of these:

    - 4: a case could not be completed (its process died or hung), or there is no case at all;
    - 3: a scene, or one of its files, is invalid;
    - 1: any other case does not pass, or cases are `missing` because the run was interrupted.
    """
    failed = {result.name for case in cases for result in case.rungs} & {"scene", "run"}
    if not cases or "run" in failed:
        return 4
    if failed:
        return 3
    return 0 if not missing and all(case.verdict in PASSING for case in cases) else 1
