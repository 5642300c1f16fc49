"""One page over all uses of the gates in a pytest session: `pytest --reference-rt-report FOLDER`,
and what they said in former sessions: `--reference-rt-history FOLDER`.

Each use is noted with its test's report, which pytest-xdist hands over from its processes; the
session's own process writes the page.  Imports nothing but pytest until a use is noted.
"""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from comparisons.gate.uses import USES, Use

if TYPE_CHECKING:
    from comparisons.gate.history import Past

NAME = "reference_rt_session"

INI = {
    "image_gate_out": "default of --image-gate-out",
    "image_gate_baselines": "default of --image-gate-baselines",
    "image_gate_limit": "default of the argument `limit` of image_gate, pair_gate, derivative_gate",
    "reference_rt_report": "default of --reference-rt-report",
    "reference_rt_history": "default of --reference-rt-history",
}
"""What pytest's configuration file may say."""

_ON_REPORT = "reference_rt_uses"
"""The attribute of a test's report: pytest-xdist hands attributes over that are JSON."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--reference-rt-report` and `--reference-rt-history`, and the defaults of all options in
    pytest's configuration file."""
    for name, what in INI.items():
        parser.addini(name, what, default="")
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
    names = (option(config, "reference_rt_report"), option(config, "reference_rt_history"))
    report, history = (None if not name else config.rootpath / name for name in names)
    return report, history


def option(config: pytest.Config, name: str) -> str:
    """An option's value, or that of pytest's configuration file; "" if there is none."""
    return str(config.getoption(name) or config.getini(name) or "")


class Session:
    """Collects the uses of a session, and writes the page and the history at its end."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._uses, self._lines = config, list[Use](), list[str]()
        self._report, self._history = folders(config)
        self._begun = time.perf_counter()
        self._ran = False

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        """Hand the uses over with the report of the phase that they belong to."""
        report = yield
        setattr(report, _ON_REPORT, item.stash.get(USES, []))
        item.stash[USES] = []
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """In the session's process, for each phase of each test."""
        self._ran = True
        outcome = {"outcome": report.outcome}
        self._uses += [use | outcome for use in getattr(report, _ON_REPORT, ())]

    def pytest_sessionfinish(self) -> None:
        """Write, unless this is a process of pytest-xdist's, or no test ran, as where an editor
        collects them: the page of the last session stays."""
        if hasattr(self._config, "workerinput") or not self._ran:
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
        if self._history is not None and order:
            past = history.added(self._history, order, self._config.rootpath)
            lines += [f"{name}: {one.words}" for name, one in past.items() if one.changes]
        if self._report is not None:
            seconds = time.perf_counter() - self._begun
            written = session_page.write(self._report, order, past, seconds)
            root = self._config.rootpath
            lines.append(", ".join(os.path.relpath(path, root) for path in written))
        return lines

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """What was written, and tests whose verdicts changed."""
        if self._lines:
            terminalreporter.section("reference_rt")
            for line in self._lines:
                terminalreporter.write_line(line)
