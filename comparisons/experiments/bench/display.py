"""Progress of a benchmark: one bar on a terminal, a line per step without one."""

from rich.console import Console
from rich.progress import TimeElapsedColumn

from comparisons.experiments.bench.row import Row
from comparisons.experiments.bench.table import amount
from reference_rt.util.console import Bar


class Display(Bar):
    """Shows on standard error what is being measured, and the rows."""

    def __init__(self, console: Console | None = None) -> None:
        super().__init__(TimeElapsedColumn(), console=console)
        self._task = self._bar.add_task("", total=1.0)
        self._group = ""
        self._shown: set[str] = set()

    def begin(self, group: str) -> None:
        """A group of rows begins."""
        self._group, self._shown = group, set()
        self._bar.reset(self._task, description=group)
        if not self._console.is_terminal:
            self.line(f"{group} ...")

    def say(self, what: str, fraction: float) -> None:
        """Show what is being measured, and the fraction of the group that is done."""
        self._bar.update(self._task, description=f"{self._group}: {what}", completed=fraction)
        if not self._console.is_terminal and what not in self._shown:
            self._shown.add(what)
            self.line(f"  {what}")

    def done(self, rows: list[Row], note: str = "") -> None:
        """Print measured rows."""
        for row in rows:
            goal = f"goal {row.goal:g}{'' if row.met else ', not met'}"
            found = f"{row.name}: {amount(row.ours, row.unit)}, ratio {row.ratio:.3g} ({goal})"
            self.line(found + (f", {note}" if note else ""))
