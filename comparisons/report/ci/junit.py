"""JUnit XML, which build servers show as tests."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from comparisons.report.ci.ranking import ranked
from comparisons.results.case import INTERRUPTED, Case
from comparisons.results.verdict import PASSING
from reference_rt.util.errors import printable
from reference_rt.util.files import replacing

_BROKEN = "invalid"
"""The verdict that makes no statement about agreement: an error, where the others are failures."""


def write(
    path: Path,
    cases: Sequence[Case],
    name: str,
    seconds: Mapping[str, float] | None = None,
    not_run: Mapping[str, str] | None = None,
    missing: Sequence[str] = (),
) -> None:
    """Write one test suite `name` of the cases, the worst first.  Raises ImageError.

    seconds: of each case by its name, where more is known than the case says;  not_run: why other
    cases were not run, by name: they are skipped tests;  missing: names of cases that an
    interrupted run did not come to: they are errors.
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
    result = kind(_legal(f"{case.verdict}: {case.reason}"), case.verdict)
    result.text = details
    test.result = [result]
    return test


def _details(case: Case) -> list[str]:
    """What there is to know about a case, a line each."""
    lines = [f"{case.scene}: {case.verdict}: {case.reason}"]
    lines += [f"{tier.name}: {tier.status}: {tier.reason}" for tier in case.tiers]
    if case.cause:
        lines.append(f"likeliest cause: {case.cause.name}: {case.cause.evidence}")
    lines += [
        f"{place.width} x {place.height} pixels at ({place.x}, {place.y}): {place.what}"
        for place in case.worst
    ]
    if case.again:
        lines.append(f"again: {case.again}")
    return lines


def _legal(text: str) -> str:
    """`text` with escapes in place of what XML 1.0 cannot hold (section 2.2, Char), and of other
    characters that do not print."""
    return printable(text, kept="\n\t")
