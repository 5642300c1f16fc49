"""One page over all uses of the gates in a pytest session: `pytest --reference-rt-report FOLDER`,
and what they said in former sessions: `--reference-rt-history FOLDER`.

Each use is noted with its test's report, which pytest-xdist hands over from its processes; the
session's own process writes the page.  Imports nothing but pytest until a use is noted.
"""

import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from comparisons.gate.history import Past
    from comparisons.gate.material import Check
    from comparisons.results.case import Case

Use = dict[str, Any]
"""A use of a gate, in JSON's types: "test" (pytest's id), "fixture", "call" (of any gate in the
test, from 1), "verdict" (a case's, or "error" of what could not be judged), "passed", "headline",
"reason", "cause" (name and evidence, or null), "z", "folder" (of the use's own outputs, or ""),
"pictures" (URLs and titles), "seconds", and in the session's process "outcome" (of the test, up to
here)."""

NAME = "reference_rt_session"
_USES = pytest.StashKey[list[Use]]()
_ON_REPORT = "reference_rt_uses"
"""The attribute of a test's report: pytest-xdist hands attributes over that are JSON."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--reference-rt-report` and `--reference-rt-history`."""
    group = parser.getgroup("image_gate")
    group.addoption(
        "--reference-rt-report",
        metavar="DIR",
        help="write report.html and results.json over all uses of image_gate, pair_gate, "
        "derivative_gate, material_gate and truth_gate; each one's own page is in DIR/tests, or "
        "where --image-gate-out says",
    )
    group.addoption(
        "--reference-rt-history",
        metavar="DIR",
        help="keep verdicts and z values of each session in this folder, and name the tests whose "
        "verdict has changed over the last ones",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Collect the uses, where a page or a history is asked for."""
    report, history = folders(config)
    if report is None and history is None:
        return
    if not hasattr(config, "workerinput"):
        from reference_rt.util.errors import ReferenceRtError
        from reference_rt.util.files import check_writable

        files = [folder / "results.json" for folder in (report, history) if folder is not None]
        try:
            check_writable(*files)
        except ReferenceRtError as error:
            raise pytest.UsageError(str(error)) from None
    config.pluginmanager.register(Session(config), NAME)


def folders(config: pytest.Config) -> tuple[Path | None, Path | None]:
    """Of the page and of the history, as the options say."""
    names = (config.getoption("--reference-rt-report"), config.getoption("--reference-rt-history"))
    report, history = (None if name is None else config.rootpath / str(name) for name in names)
    return report, history


def note(item: pytest.Item, fixture: str, call: int, **what: Any) -> None:
    """Note a use;  what: the other values of a `Use`."""
    use = {"test": item.nodeid, "fixture": fixture, "call": call, "folder": ""}
    use |= {"headline": "", "reason": "", "cause": None, "z": None, "pictures": [], "seconds": 0.0}
    item.stash.setdefault(_USES, []).append(use | what)


def of_case(case: "Case", passed: bool) -> Use:
    """What is noted of a case."""
    from comparisons.report.thumbnails import small_pictures
    from comparisons.results.files import plain
    from comparisons.results.headline import headline

    cause = None
    if case.cause is not None:
        cause = {"name": case.cause.name, "evidence": case.cause.evidence}
    return {
        "verdict": case.verdict,
        "passed": passed,
        "headline": headline(case),
        "reason": case.reason,
        "cause": cause,
        "z": plain(z_of(case)),
        "pictures": small_pictures(case),
    }


def of_checks(checks: "Sequence[Check]", pictures: Sequence[Path]) -> Use:
    """What is noted of the checks of a material.  pictures: files of what is wrong."""
    from comparisons.report.thumbnails import shrunk_url

    failed = [check for check in checks if not check]
    reasons = [f"{check.name}: {check.reason}" for check in failed or checks]
    return {
        "verdict": "differ" if failed else "agree",
        "passed": not failed,
        "headline": "; ".join(reasons[:1]) if failed else "no check found anything",
        "reason": "; ".join(reasons),
        "folder": str(pictures[0].parent) if pictures else "",
        "pictures": [(shrunk_url(path), path.stem) for path in pictures],
    }


def z_of(case: "Case") -> float | None:
    """The bias of the image mean in standard errors, of the channel that is farthest from zero;
    None without noise."""
    for rung in case.rungs:
        biases, errors = (
            rung.numbers.get(key) for key in ("relative_bias", "standard_error_of_bias")
        )
        if isinstance(biases, dict) and isinstance(errors, dict):
            pairs = [(b, errors.get(name)) for name, b in biases.items()]
            found = [bias / error for bias, error in pairs if bias is not None and error]
            return max(found, key=abs, default=None)
    return None


class Session:
    """Collects the uses of a session, and writes the page and the history at its end."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._uses, self._lines = config, list[Use](), list[str]()
        self._report, self._history = folders(config)
        self._begun = time.perf_counter()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        """Hand the uses over with the report of the phase that they belong to."""
        report = yield
        setattr(report, _ON_REPORT, item.stash.get(_USES, []))
        item.stash[_USES] = []
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """In the session's process, for each phase of each test."""
        outcome = {"outcome": report.outcome}
        self._uses += [use | outcome for use in getattr(report, _ON_REPORT, ())]

    def pytest_sessionfinish(self) -> None:
        """Write, unless this is a process of pytest-xdist's."""
        if hasattr(self._config, "workerinput"):
            return
        from reference_rt.util.errors import ReferenceRtError

        try:
            self._lines = self._written()
        except ReferenceRtError as error:
            self._lines = [f"not written: {error}"]
        except ModuleNotFoundError as error:
            from reference_rt.util.extras import needs

            self._lines = [needs("--reference-rt-report", "compare", error.name)]

    def _written(self) -> list[str]:
        """Write the history and the page; lines about them."""
        from comparisons.gate import history, session_page

        order = sorted(self._uses, key=lambda use: (use["test"], use["fixture"], use["call"]))
        lines = [session_page.counted(order)]
        past: dict[str, Past] = {}
        if self._history is not None:
            past = history.added(self._history, order, self._config.rootpath)
            lines += [f"{name}: {one.words}" for name, one in past.items() if one.changes]
        if self._report is not None:
            seconds = time.perf_counter() - self._begun
            written = session_page.write(self._report, order, past, seconds)
            lines.append(", ".join(relative(path, self._config.rootpath) for path in written))
        return lines

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """What was written, and tests whose verdicts changed."""
        if self._lines:
            terminalreporter.section("reference_rt")
            for line in self._lines:
                terminalreporter.write_line(line)


def key_of(use: Use) -> str:
    """The name of a use, the same in each session."""
    number = "" if use["call"] == 1 else f" {use['call']}"
    return f"{use['test']} ({use['fixture']}{number})"


def relative(path: str | Path, folder: Path) -> str:
    """A path as seen from a folder."""
    return Path(os.path.relpath(path, folder)).as_posix()
