"""The result of a suite for a planted fault."""

from dataclasses import asdict, dataclass
from typing import Any

from comparisons.experiments.selftest.fault import Fault, PictureFault, SceneFault
from comparisons.results.case import RUNGS, Case

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
