"""Rows of a benchmark with made-up times, for its tests."""

from comparisons.experiments.bench.outputs import markdown
from comparisons.experiments.bench.row import Row, against
from comparisons.experiments.bench.run import machine

FIELDS = {"name", "ours", "peer", "peer_name", "ratio", "goal", "spread", "unit", "better", "met"}


def made_up(name: str = "one", ratio: float = 0.5, goal: float = 0.8) -> Row:
    """A row whose measured times have exactly this ratio."""
    return against(name, f"the row {name}", [ratio] * 7, ("another", [1.0] * 7), goal)


def a_table(rows: list[Row]) -> str:
    """The table of these rows."""
    return markdown(rows, machine(), {"cold": "no time"})
