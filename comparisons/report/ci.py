"""Results of a run in the formats of CI services: JUnit XML (a test per case); GitHub annotations
and the step summary, within GitHub's size limits; the worst cases first.
"""

import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TextIO

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


@dataclass(frozen=True)
class Formats:
    """What is written for a CI service.  junit: the file of JUnit XML, None for none;  github:
    whether to write annotations and a step's summary outside of GitHub Actions, too."""

    junit: Path | None
    github: bool

    @property
    def _on_github(self) -> bool:
        return self.github or os.environ.get("GITHUB_ACTIONS") == "true"

    @property
    def _summary(self) -> Path | None:
        path = os.environ.get("GITHUB_STEP_SUMMARY") if self._on_github else None
        return Path(path) if path else None

    @property
    def files(self) -> list[Path]:
        """Those that `write` writes."""
        return [path for path in (self.junit, self._summary) if path is not None]

    def write(
        self,
        name: str,
        cases: Sequence[Case],
        files: Mapping[str, str],
        walls: Mapping[str, float] | None = None,
        not_run: Mapping[str, str] | None = None,
        missing: Sequence[str] = (),
        title: str = "",
    ) -> None:
        """Write all of them.  title: of the summary, by default the name;  the others as `annotate`
        and `write_junit` have them.  Raises ImageError."""
        if self.junit is not None:
            write_junit(self.junit, cases, name, walls, not_run, missing)
        if self._on_github:
            annotate(cases, sys.stdout, files, missing)
        if self._summary is not None:
            summarise(cases, self._summary, title or name, not_run, missing)


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
    tests = [_test(case, (seconds or {}).get(case.scene)) for case in ranked(cases)]
    tests += [Test(left, Error(INTERRUPTED, "missing")) for left in missing]
    tests += [Test(left, Skipped(_legal(why))) for left, why in (not_run or {}).items()]
    write_tests(path, name, tests)


class Test(NamedTuple):
    """result: None if it passed;  details: beside the result."""

    name: str
    result: Error | Failure | Skipped | None = None
    details: str = ""
    seconds: float = 0.0


def write_tests(path: Path, name: str, tests: Iterable[Test]) -> None:
    """Write one suite as JUnit XML, whole or not at all.  Raises ImageError."""
    suite = TestSuite(_legal(name))
    for test in tests:
        written = TestCase(_legal(test.name), _legal(name), round(test.seconds, 3))
        details = _legal(test.details)
        if test.result is not None:
            test.result.text = details or None
            written.result = [test.result]
        elif details:
            written.system_out = details
        suite.add_testcase(written)
    document = JUnitXml(_legal(name))
    document.add_testsuite(suite)
    document.update_statistics()
    with replacing(path) as temporary:
        document.write(str(temporary), pretty=True)


def _test(case: Case, seconds: float | None) -> Test:
    """seconds: None for the sum over its steps."""
    if seconds is None:
        seconds = sum(sum(times.values()) for times in case.seconds.values())
    kind = Error if case.verdict == _BROKEN else Failure
    result = kind(_legal(f"{case.verdict}: {headline(case)}"), case.verdict)
    told = "\n".join(_details(case))
    return Test(case.scene, None if case.verdict in PASSING else result, told, seconds)


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
