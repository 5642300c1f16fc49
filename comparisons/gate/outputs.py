"""The outputs of a gate: results.json and the page; its exit code."""

from pathlib import Path
from typing import Any

from comparisons.report import write_report, write_results
from comparisons.results.case import Case, exit_code
from comparisons.runs.provenance import ours
from reference_rt.util.files import discard


def write(
    case: Case, out: Path, facts: dict[str, Any], wall: float | None = None, page: bool = True
) -> tuple[Path, Path | None]:
    """`results.json` and `report.html` in `out`; their paths.  Raises ImageError.

    facts: provenance besides versions, date and machine, such as the baseline;  wall: seconds that
    the gate took in all.
    """
    provenance = {**ours(), **facts}
    results, report = out / "results.json", out / "report.html"
    write_results(results, [case], provenance)
    if not page:
        discard(report)
        return results, None
    write_report(report, [case], provenance, walls={} if wall is None else {case.scene: wall})
    return results, report


def code_of(case: Case) -> int:
    """The exit code: 0 if the candidate passes, 3 if it is invalid, else 1."""
    return 3 if case.verdict == "invalid" else exit_code([case])
