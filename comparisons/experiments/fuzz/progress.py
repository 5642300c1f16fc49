"""Progress of a run on standard error: a bar on a terminal, and a line for each finding."""

from rich.progress import MofNCompleteColumn, TimeElapsedColumn

from comparisons.experiments.fuzz.finding import Checked
from reference_rt.util.console import Bar


class Display(Bar):
    """Counts scenes and findings.  scenes: how many are to come; None: until the time is up."""

    def __init__(self, scenes: int | None) -> None:
        super().__init__(MofNCompleteColumn(), TimeElapsedColumn())
        self._task = self._bar.add_task("scenes", total=scenes)
        self._done = 0
        self._findings = 0

    def done(self, checked: Checked) -> None:
        """A scene has been checked."""
        self._done += 1
        for finding in checked.findings:
            self._findings += 1
            self.line(f"scene {checked.number}: {finding.rung}: {finding.cause}")
        self._bar.update(self._task, advance=1, description=f"{self._findings} findings")
        if not self.is_terminal and self._done % 100 == 0:
            self.line(f"{self._done} scenes, {self._findings} findings")
