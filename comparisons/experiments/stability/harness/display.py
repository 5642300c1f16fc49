"""Progress for people: a bar on a terminal, else a line for each sweep point."""

from rich.progress import MofNCompleteColumn, TimeElapsedColumn

from comparisons.experiments.stability.harness.core import MITSUBA, OURS, Found
from reference_rt.util.console import Bar


class Display(Bar):
    """The bar."""

    def __init__(self, settings: int) -> None:
        super().__init__(MofNCompleteColumn(), TimeElapsedColumn())
        self._task = self._bar.add_task("", total=settings)

    def done(self, found: Found, remark: str) -> None:
        """Count a point; failures of ours are printed, and without a terminal everything."""
        self._bar.update(self._task, advance=1, description=f"{found.family} {found.series}")
        bad = found.broken or (found.ours is not None and found.ours.failures)
        if not self._console.is_terminal or bad:
            self.line(f"{found.family} {found.series} {found.x:g}: {said(found)} ({remark})")


def said(found: Found) -> str:
    """The outcomes of a point in a line."""
    if found.broken:
        return f"not measured: {found.broken}"
    shown = []
    for name in sorted(found.outcomes, key=lambda n: (n != OURS, n != MITSUBA, n)):
        some = found.outcomes[name]
        worst = "" if some.worst is None else f", worst {some.worst:.2g}"
        shown.append(f"{name} {some.failures:,} of {some.cases:,}{worst}")
    return "; ".join(shown)
