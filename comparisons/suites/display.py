"""Progress of a suite on standard error: a bar with the running cases on a terminal, otherwise a
line per case."""

from collections import Counter
from collections.abc import Mapping, Sequence

from rich.text import Text

from comparisons.report import terminal
from comparisons.report.ci.ranking import ranked
from comparisons.results.case import WARNING, Case, how_many
from comparisons.results.files import named
from comparisons.results.headline import first_difference, headline
from comparisons.results.verdict import PASSING
from comparisons.runs.engine import Count
from comparisons.suites.worker import Request

_STYLES = {
    "agree": "green",
    "unchanged": "green",
    "reference-limited": "cyan",
    "inconclusive": "yellow",
    "not-comparable": "yellow",
    "differ": "bold red",
    "invalid": "bold red",
}

_COLUMNS = ("case", "verdict", "likeliest cause", "first difference", "seconds")

_SLOWEST = 3


class Display(Count):
    """Shows the progress of cases.  steps: print every step and every reason, for runs of few
    cases."""

    def __init__(self, cases: int, steps: bool = False) -> None:
        super().__init__(cases)
        self._steps = steps
        self._running: dict[str, str] = {}

    def doing(self, request: Request, step: str) -> None:
        """A case has begun (step ""), or has reached `step`."""
        self._running[request.name] = step
        if self._steps and step:
            self.line(f"{request.name}: {step}")
        self._show()

    def done(self, case: Case, remark: str) -> None:
        """A case has ended."""
        self._running.pop(case.scene, None)
        for note in case.notes:
            if note.startswith(WARNING):
                self.line(note)
        line = Text.assemble(f"{case.scene}: ", (case.verdict, _STYLES[case.verdict]))
        line.append(f" ({remark})")
        if self._steps or case.verdict not in PASSING:
            line.append(named(f": {headline(case)}\n  {case.reason}", case.sides))
        self._console.print(line, soft_wrap=True)
        self._show(1)

    def _show(self, ended: int = 0) -> None:
        running = [f"{name} {step}".rstrip() for name, step in self._running.items()]
        self.count(", ".join(running)[: self._console.width // 2], ended)


def summarise(
    cases: Sequence[Case],
    walls: Mapping[str, float],
    not_run: Mapping[str, str],
    missing: Sequence[str] = (),
    every: bool = False,
) -> None:
    """Print counts of the verdicts, failed cases with their causes and their first differences, the
    slowest cases, skipped cases, and those that an interrupted run did not reach.

    every: whether cases that have not failed are in the table, too.
    """
    console = terminal.console(stderr=True)
    counts = Counter(case.verdict for case in cases)
    verdicts = ", ".join(f"{number} {verdict}" for verdict, number in counts.most_common())
    verdicts = f": {verdicts}" if verdicts else ""
    console.print(f"{how_many(len(cases), len(missing))}{verdicts}", markup=False)
    shown = [case for case in ranked(cases) if every or case.verdict not in PASSING]
    if shown:
        rows = [
            (
                case.scene,
                Text(case.verdict, _STYLES[case.verdict]),
                "" if case.cause is None else case.cause.name,
                named(first_difference(case), case.sides),
                f"{walls[case.scene]:.1f}" if case.scene in walls else "",
            )
            for case in shown
        ]
        console.print(terminal.fitted(console.width, _COLUMNS, rows, right=("seconds",)))
    slowest = sorted(walls, key=lambda name: walls[name], reverse=True)[:_SLOWEST]
    if slowest:
        times = ", ".join(f"{name} {walls[name]:.1f} s" for name in slowest)
        console.print(f"slowest: {times}", markup=False, soft_wrap=True)
    for name, why in not_run.items():
        console.print(f"not run: {name}: {why}", markup=False, soft_wrap=True)
    if missing:
        console.print(f"missing: {', '.join(missing)}", markup=False, soft_wrap=True)
