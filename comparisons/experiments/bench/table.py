"""The rows for people: tables for a terminal and as Markdown, and progress on standard error."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console, RenderableType
from rich.progress import TimeElapsedColumn

from comparisons.experiments.bench.row import LIMIT, Row
from comparisons.report.terminal import fitted
from reference_rt.util.console import Bar

_COLUMNS = ("what", "ours", "against", "ratio", "quartiles", "goal", "met")


def terminal(rows: Sequence[Row], width: int) -> RenderableType:
    """The table for a terminal of so many columns."""
    styles = [None if row.met else "yellow" for row in rows]
    return fitted(width, _COLUMNS, [_cells(row) for row in rows], styles=styles)


def markdown(
    rows: Sequence[Row], machine: Mapping[str, Any], not_measured: Mapping[str, str]
) -> str:
    """The table with its date and machine."""
    lines = [described(machine), ""]
    lines.append("| " + " | ".join(_COLUMNS) + " |")
    lines.append("|---" * len(_COLUMNS) + "|")
    lines += ["| " + " | ".join(c.replace("|", "\\|") for c in _cells(row)) + " |" for row in rows]
    if not_measured:
        lines += ["", "Not measured: " + "; ".join(f"{k} ({v})" for k, v in not_measured.items())]
    return "\n".join(lines) + "\n"


def described(machine: Mapping[str, Any]) -> str:
    """The machine in a sentence."""
    parts = [
        f"{machine['date'][:10]}",
        f"{machine['machine']}",
        f"{machine['cores']} cores",
        f"{machine['vector_bits']}-bit vectors",
        f"{machine['memory_gib']} GiB",
        f"{machine['system']}",
        f"Python {machine['python']}",
        f"Numba {machine['numba']}",
        f"Mitsuba {machine['mitsuba']}",
    ]
    return "Measured: " + ", ".join(p for p in parts if "None" not in p) + "."


def _cells(row: Row) -> list[str]:
    around = row.spread.get("ratio")
    sign = "≤" if row.better == "lower" else "≥"
    return [
        row.title,
        amount(row.ours, row.unit),
        f"{amount(row.peer, row.unit)} ({row.peer_name})",
        f"{row.ratio:.2f}",
        "" if around is None or row.peer_name == LIMIT else f"{around[0]:.2f} to {around[1]:.2f}",
        f"{sign} {row.goal:g}",
        "yes" if row.met else "no",
    ]


def amount(value: float, unit: str) -> str:
    """A number with three significant digits, and its unit."""
    return f"{value:.0f} {unit}" if value >= 1000.0 else f"{value:.3g} {unit}"


# ---- progress -----------------------------------------------------------------------------------


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
