"""The rows for people: tables for a terminal and as Markdown, and progress on standard error."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rich.console import Console, Group, RenderableType
from rich.progress import TimeElapsedColumn

from comparisons.experiments.bench import scenes
from comparisons.experiments.bench.row import LIMIT, Row
from comparisons.report.table import Column, Table
from reference_rt.util.console import Bar

# ---- tables -------------------------------------------------------------------------------------


def _two(ratio: float) -> str:
    return f"{ratio:.2f}"


def _quartiles(row: Row) -> str:
    around = row.spread.get("ratio")
    return "" if around is None or row.peer_name == LIMIT else f"{around[0]:.2f} to {around[1]:.2f}"


COLUMNS = (
    Column[Row]("what", lambda row: row.title),
    Column[Row]("ours", lambda row: amount(row.ours, row.unit)),
    Column[Row]("against", lambda row: f"{amount(row.peer, row.unit)} ({row.peer_name})"),
    Column[Row]("ratio", lambda row: row.ratio, _two),
    Column[Row]("quartiles", _quartiles),
    Column[Row]("goal", lambda row: f"{'≤' if row.better == 'lower' else '≥'} {row.goal:g}"),
    Column[Row]("met", lambda row: "yes" if row.met else "no"),
)


class OfScene(NamedTuple):
    """What a line says of a scene: its row of times at equal samples, and the ratios of error times
    time to Mitsuba's with its default and with its best sampler."""

    samples: Row
    default: float
    best: float


OF_SCENE = (
    Column[OfScene]("scene", lambda one: scenes.scene_of(one.samples)),
    Column[OfScene]("pixels", lambda one: "{width}x{height}".format(**one.samples.details)),
    Column[OfScene]("ours", lambda one: f"{one.samples.ours:.3g} s"),
    Column[OfScene]("Mitsuba llvm", lambda one: f"{one.samples.peer:.3g} s"),
    Column[OfScene]("ratio", lambda one: one.samples.ratio, _two),
    Column[OfScene]("quartiles", lambda one: _quartiles(one.samples)),
    Column[OfScene]("relMSE x time / default", lambda one: one.default, _two),
    Column[OfScene]("/ best", lambda one: one.best, _two),
    Column[OfScene](
        "sampler",
        lambda one: (
            one.samples.details["sampler"] + ", another picture" * scenes.is_other(one.samples)
        ),
    ),
)


def tables_of(rows: Sequence[Row]) -> list[Table[Any]]:
    """Of the rows that are no scene's, and, if there are any, of the scenes, the worst beside
    Mitsuba's best sampler first."""
    ratios = {row.name: row.ratio for row in rows}
    each = [
        OfScene(row, *(ratios[f"{scenes.scene_of(row)}.{peer}"] for peer in ("default", "best")))
        for row in scenes.of_kind(rows, "samples")
    ]
    each.sort(key=lambda one: -one.best)
    apart = [row for row in rows if not scenes.scene_of(row)]
    others = Table(COLUMNS, apart, lambda row: "" if row.met else "missed")
    return [others, *([Table(OF_SCENE, each)] if each else [])]


def terminal(rows: Sequence[Row], width: int) -> RenderableType:
    """The tables for a terminal of so many columns: what is no scene's last, above the prompt."""
    return Group(*(table.terminal(width) for table in reversed(tables_of(rows))))


def markdown(
    rows: Sequence[Row], machine: Mapping[str, Any], not_measured: Mapping[str, str]
) -> str:
    """The tables with their date and machine."""
    lines = [_described(machine)]
    for table in tables_of(rows):
        lines += ["", *table.markdown()]
    if not_measured:
        lines += ["", "Not measured: " + "; ".join(f"{k} ({v})" for k, v in not_measured.items())]
    return "\n".join(lines) + "\n"


def _described(machine: Mapping[str, Any]) -> str:
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
