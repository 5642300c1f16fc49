"""JUnit XML, which CI services show as test results: a test per case."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from comparisons.report.ci.ranking import ranked
from comparisons.results.case import INTERRUPTED, Case
from comparisons.results.headline import headline
from comparisons.results.verdict import PASSING
from reference_rt.util.errors import printable
from reference_rt.util.files import replacing

_BROKEN = "invalid"
"""This verdict says nothing about agreement: it is an error, other verdicts are failures."""


def write(
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
