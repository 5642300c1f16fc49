"""Progress of a benchmark: one bar on a terminal, a line per step without one."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from comparisons.bench.row import Row
from comparisons.bench.table import amount


class Display:
    """Tells on standard error what is being measured and what was found."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True, highlight=False)
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TimeElapsedColumn(),
            console=self._console,
            transient=True,
        )
        self._task = self._bar.add_task("", total=1.0)
        self._group = ""
        self._told: set[str] = set()

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def begin(self, group: str) -> None:
        """A group of rows is begun."""
        self._group, self._told = group, set()
        self._bar.reset(self._task, description=group)
        if not self._console.is_terminal:
            self.line(f"{group} ...")

    def say(self, what: str, fraction: float) -> None:
        """What is measured now, and the fraction of the group that is done."""
        self._bar.update(self._task, description=f"{self._group}: {what}", completed=fraction)
        if not self._console.is_terminal and what not in self._told:
            self._told.add(what)
            self.line(f"  {what}")

    def done(self, rows: list[Row], note: str = "") -> None:
        """Rows are known."""
        for row in rows:
            goal = f"goal {row.goal:g}{'' if row.met else ', not met'}"
            found = f"{row.name}: {amount(row.ours, row.unit)}, ratio {row.ratio:.3g} ({goal})"
            self.line(found + (f", {note}" if note else ""))

    def line(self, text: str) -> None:
        """One line for people."""
        self._console.print(text, markup=False, soft_wrap=True)
