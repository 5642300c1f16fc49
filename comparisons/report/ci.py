"""Results of a run in the formats of CI services: JUnit XML (a test per case); GitHub annotations
and the step summary, within GitHub's size limits; the worst cases first.
"""

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from comparisons.report.table import table_of
from comparisons.results.case import INTERRUPTED, PASSING, Case, Status, how_many
from comparisons.results.headline import headline
from comparisons.results.rungs import RUNGS
from reference_rt.util.errors import ImageError, printable
from reference_rt.util.files import replacing

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


MOST_ANNOTATIONS = 10
"""Annotations of each kind per step; GitHub silently drops any more."""

MOST_BYTES = 1 << 20
"""Size limit of a step's summary; GitHub drops a longer one entirely."""

_ROOM = 256
"""Bytes reserved for the line that says how many cases are not shown."""

_MOST_CHARACTERS = 1000
"""Length at which a reason is cut; results.json has all of it."""

_KINDS = {"invalid": "error", "differ": "error", "inconclusive": "warning"} | {
    "not-comparable": "warning"
}


def is_there() -> bool:
    """Whether this runs as a step of GitHub Actions."""
    return os.environ.get("GITHUB_ACTIONS") == "true"


def summary_path() -> Path | None:
    """The file of the step's summary; None outside of GitHub Actions."""
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    return Path(path) if path else None


def annotate(
    cases: Sequence[Case],
    stream: TextIO,
    files: Mapping[str, str] | None = None,
    missing: Sequence[str] = (),
) -> None:
    """Write an annotation for each case that fails, the worst first: errors for `invalid` and
    `differ`, warnings for `inconclusive` and `not-comparable`.

    files: each case's scene file, by the case's name;  missing: names of cases that an interrupted
    run did not reach, reported by one error.  If there are more cases than annotations, the last
    annotation names the others.
    """
    if missing:
        title = {"title": how_many(len(cases), len(missing))}
        _command(stream, "error", title, _cut(f"Missing: {', '.join(missing)}"))
    for kind in ("error", "warning"):
        failed = [case for case in ranked(cases) if _KINDS.get(case.verdict) == kind]
        most = MOST_ANNOTATIONS - (1 if missing and kind == "error" else 0)
        shown = failed if len(failed) <= most else failed[: most - 1]
        for case in shown:
            where = {"title": f"{case.scene}: {case.verdict}"}
            if files and case.scene in files:
                where = {"file": files[case.scene], **where}
            _command(stream, kind, where, _message(case))
        if len(failed) > len(shown):
            number = len(failed) - len(shown)
            title = {"title": f"{number} more cases"}
            names = ", ".join(case.scene for case in failed[len(shown) :])
            _command(stream, kind, title, _cut(f"Not shown here: {names}"))


def _command(stream: TextIO, kind: str, properties: Mapping[str, str], message: str) -> None:
    joined = ",".join(f"{key}={_property(value)}" for key, value in properties.items())
    stream.write(f"::{kind} {joined}::{_data(message)}\n")
    stream.flush()


def _message(case: Case) -> str:
    lines = [_cut(headline(case)), _cut(case.reason)]
    if case.cause:
        lines.append(_cut(f"{case.cause.name}: {case.cause.evidence}"))
    if case.again:
        lines.append(f"Reproduce: {case.again}")
    return "\n".join(lines)


def _data(text: str) -> str:
    """Escapes of a workflow command's message (actions/toolkit, `escapeData`)."""
    return (
        printable(text, kept="\r\n").replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    )


def _property(text: str) -> str:
    """Escapes of a workflow command's property (actions/toolkit, `escapeProperty`)."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")


def summarise(
    cases: Sequence[Case],
    path: Path,
    title: str,
    not_run: Mapping[str, str] | None = None,
    missing: Sequence[str] = (),
) -> None:
    """Append a summary in Markdown: counts, then a table of as many cases as fit, the worst first.

    not_run: why other cases were skipped, by name;  missing: names of cases that an interrupted run
    did not reach.  Raises ImageError where the file cannot be written.
    """
    counts = Counter(case.verdict for case in cases)
    verdicts = ", ".join(f"**{counts[v]}** {v}" for v in SEVERITY if counts[v])
    head = f"## {_markdown(title)}\n\n{how_many(len(cases), len(missing))}: "
    head += f"{verdicts or 'no case was run'}\n\n"
    rows = [(name, "❌ missing", INTERRUPTED) for name in missing]
    rows += [(case.scene, _signed(case.verdict), headline(case)) for case in ranked(cases)]
    rows += [(name, "not run", why) for name, why in (not_run or {}).items()]
    cells = [(name, verdict, _cut(why)) for name, verdict, why in rows]
    names, line, *lines = table_of(("case", "verdict", "reason"), cells).markdown(_markdown)
    head += f"{names}\n{line}\n"
    try:
        used = path.stat().st_size if path.exists() else 0
        text = head + _fitting(lines, MOST_BYTES - used - len(head.encode()) - _ROOM)
        if used + len(text.encode()) > MOST_BYTES:
            return  # GitHub would drop the earlier part of the summary too
        with path.open("a", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except OSError as error:
        raise ImageError(f"{path}: cannot be written: {error.strerror}") from None


def _fitting(lines: Sequence[str], room: int) -> str:
    kept: list[str] = []
    for line in lines:
        room -= len(line.encode()) + 1
        if room < 0:
            break
        kept.append(f"{line}\n")
    if len(kept) < len(lines):
        kept.append(f"\n{len(lines) - len(kept)} more cases are not shown: size limit.\n")
    return "".join([*kept, "\n"])


def _signed(verdict: Status) -> str:
    return f"{'✅' if verdict in PASSING else '❌'} {verdict}"


def _cut(text: str) -> str:
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]} ..."


def _markdown(text: str) -> str:
    """`text` on one line, with all markup escaped."""
    return re.sub(
        r"([\\`*_\[\]<>|~&#!@$])", r"\\\1", " ".join(printable(text, kept="\r\n\t").split())
    )


_BROKEN = "invalid"
"""This verdict says nothing about agreement: it is an error, other verdicts are failures."""


def write_junit(
    path: Path,
    cases: Sequence[Case],
    name: str,
    seconds: Mapping[str, float] | None = None,
    not_run: Mapping[str, str] | None = None,
    missing: Sequence[str] = (),
) -> None:
    """Write one test suite `name` of the cases, the worst first.  Raises ImageError.

    seconds: of whole cases by name, by default the sum over their steps;  not_run: why other cases
    were skipped, by name: skipped tests;  missing: names of cases that an interrupted run did not
    reach: errors.
    """
    suite = TestSuite(_legal(name))
    for case in ranked(cases):
        of_steps = sum(sum(times.values()) for times in case.seconds.values())
        suite.add_testcase(_test(case, name, (seconds or {}).get(case.scene, of_steps)))
    for left in missing:
        suite.add_testcase(_without_case(left, name, Error(INTERRUPTED, "missing")))
    for skipped, why in (not_run or {}).items():
        suite.add_testcase(_without_case(skipped, name, Skipped(_legal(why))))
    document = JUnitXml(_legal(name))
    document.add_testsuite(suite)
    document.update_statistics()
    with replacing(path) as temporary:
        document.write(str(temporary), pretty=True)


def _without_case(case: str, suite: str, result: Error | Skipped) -> TestCase:
    test = TestCase(_legal(case), _legal(suite), 0.0)
    test.result = [result]
    return test


def _test(case: Case, suite: str, seconds: float) -> TestCase:
    test = TestCase(_legal(case.scene), _legal(suite), round(seconds, 3))
    details = _legal("\n".join(_details(case)))
    if case.verdict in PASSING:
        test.system_out = details
        return test
    kind = Error if case.verdict == _BROKEN else Failure
    result = kind(_legal(f"{case.verdict}: {headline(case)}"), case.verdict)
    result.text = details
    test.result = [result]
    return test


def _details(case: Case) -> list[str]:
    """The text of a case's test, line by line."""
    lines = [f"{case.scene}: {case.verdict}: {headline(case)}", case.reason]
    lines += [f"{rung.name}: {rung.status}: {rung.reason}" for rung in case.rungs]
    if case.cause:
        lines.append(f"{case.cause.name}: {case.cause.evidence}")
    lines += [
        f"{place.width} x {place.height} pixels at ({place.x}, {place.y}): {place.what}"
        for place in case.worst
    ]
    if case.again:
        lines.append(f"reproduce: {case.again}")
    return lines


def _legal(text: str) -> str:
    """`text`, in which characters that XML 1.0 does not allow (section 2.2, Char) and other
    unprintable ones are escaped."""
    return printable(text, kept="\n\t")
