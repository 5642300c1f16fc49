"""The outputs of a gate: results.json, the page, JUnit XML and GitHub's annotations."""

import sys
from pathlib import Path
from typing import Any

from comparisons.report import ci, write_report, write_results
from comparisons.results.case import Case, exit_code
from comparisons.runs.provenance import ours
from reference_rt.util.files import check_writable


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
        report.unlink(missing_ok=True)
        return results, None
    write_report(report, [case], provenance, walls={} if wall is None else {case.scene: wall})
    return results, report


def prepare(out: Path, *others: Path) -> None:
    """Check that `write` can write to `out`, and that these other files can be written; remove the
    outputs of an earlier gate.  Raises ImageError."""
    files = out / "results.json", out / "report.html"
    check_writable(*files, *others)
    for file in files:
        file.unlink(missing_ok=True)


def ci_files(junit_file: Path | None, annotate: bool) -> tuple[Path, ...]:
    """The files that `for_ci` writes."""
    summary = ci.summary_path() if annotate or ci.is_there() else None
    return tuple(path for path in (junit_file, summary) if path is not None)


def for_ci(case: Case, junit_file: Path | None, about: str, annotate: bool) -> None:
    """Write JUnit XML if requested, annotations and a summary if requested or in GitHub Actions.

    about: the scene file that annotations refer to, "" for none.  Raises ImageError.
    """
    if junit_file is not None:
        ci.write_junit(junit_file, [case], "gate")
    if annotate or ci.is_there():
        ci.annotate([case], sys.stdout, {case.scene: about} if about else None)
        if (summary := ci.summary_path()) is not None:
            ci.summarise([case], summary, f"gate: {case.scene}")


def code_of(case: Case) -> int:
    """The exit code: 0 if the candidate passes, 3 if it is invalid, else 1."""
    return 3 if case.verdict == "invalid" else exit_code([case])
