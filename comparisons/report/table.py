"""Tables: their columns are declared once, and printed for people and for machines.

A table is printed to a terminal of any width, as Markdown and as CSV; `records` are for JSON, and
the macro `numbers` of `macros.html.jinja` puts it on a page.
"""

import csv
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from rich.console import RenderableType
from rich.text import Text

from comparisons.report.terminal import fitted
from comparisons.results.files import plain
from reference_rt.util.files import replacing

R = TypeVar("R")


class Cell(NamedTuple):
    """What people read in a cell;  small: a remark, and look: a CSS class, on pages alone."""

    text: str
    small: str = ""
    look: str = ""


Shown = str | Cell | Text

STYLES = {"failed": "bold red", "missed": "yellow"}
"""Of marked rows, on a terminal."""


def _text(cell: Shown) -> str:
    return cell if isinstance(cell, str) else cell.text if isinstance(cell, Cell) else cell.plain


def _without_bars(text: str) -> str:
    return text.replace("|", "\\|")


def _as_it_is(value: Any) -> Shown:
    return value if isinstance(value, Shown) else str(value)


@dataclass(frozen=True)
class Column(Generic[R]):
    """heading: for people, who do not see a column that has None;  of: the value of a row;  text:
    how people read it;  right: whether it is aligned at its right edge, on a terminal;  look: a CSS
    class, on a page;  key: its name in files for machines, which have no column without one."""

    heading: str | None
    of: Callable[[R], Any]
    text: Callable[[Any], Shown] = _as_it_is
    right: bool = False
    look: str = ""
    key: str = ""


@dataclass(frozen=True)
class Table(Generic[R]):
    """Rows of anything, and the columns that show it;  mark: of a row that stands out: the name of
    its look on a terminal (`STYLES`), and a CSS class on a page."""

    columns: Sequence[Column[R]]
    rows: Sequence[R]
    mark: Callable[[R], str] = lambda row: ""

    @property
    def seen(self) -> list[Column[R]]:
        """The columns for people."""
        return [column for column in self.columns if column.heading is not None]

    @property
    def head(self) -> list[str]:
        """The headings."""
        return [str(column.heading) for column in self.seen]

    @property
    def cells(self) -> list[list[Shown]]:
        """What people see below the headings, row by row."""
        return [[column.text(column.of(row)) for column in self.seen] for row in self.rows]

    @property
    def marked(self) -> list[tuple[str, list[str | Cell]]]:
        """The mark of each row and its cells, for a page."""
        plain_text = [[c.plain if isinstance(c, Text) else c for c in row] for row in self.cells]
        return [(self.mark(row), cells) for row, cells in zip(self.rows, plain_text, strict=True)]

    def terminal(self, width: int, title: str = "") -> RenderableType:
        """For a terminal of so many columns."""
        cells = [[c.text if isinstance(c, Cell) else c for c in row] for row in self.cells]
        right = [column.right for column in self.seen]
        styles = [STYLES.get(self.mark(row)) for row in self.rows]
        return fitted(width, self.head, cells, styles, right, title)

    def markdown(self, escaped: Callable[[str], str] = _without_bars) -> list[str]:
        """The lines of a table;  escaped: what is markup in the text of a cell."""
        rows: list[list[Shown]] = [[*self.head], *self.cells]
        lines = (" | ".join(escaped(_text(cell)) for cell in row) for row in rows)
        head, *body = [f"| {line} |" for line in lines]
        return [head, "|---" * len(self.head) + "|", *body]

    def records(self) -> list[dict[str, Any]]:
        """An object for each row, in the types of strict JSON."""
        named = [column for column in self.columns if column.key]
        return [{column.key: plain(column.of(row)) for column in named} for row in self.rows]

    def write_csv(self, path: Path) -> None:
        """Write what `records` has, whole or not at all; null is an empty cell."""
        with (
            replacing(path) as temporary,
            temporary.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file,
        ):
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([column.key for column in self.columns if column.key])
            writer.writerows(record.values() for record in self.records())


def table_of(
    head: Sequence[str], rows: Iterable[Sequence[Shown]], right: Container[int] = ()
) -> Table[Sequence[Shown]]:
    """A table whose cells are written already;  right: the columns that are aligned there."""
    columns: list[Column[Sequence[Shown]]] = [
        Column(name, itemgetter(k), right=k in right) for k, name in enumerate(head)
    ]
    return Table(columns, list(rows))
