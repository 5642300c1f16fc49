"""Tables for terminals of any width: no cell is folded more than twice.

A table that is too wide for that is written as records: a line per row, and below it one line for
each of its other cells.
"""

import os
import textwrap
from collections.abc import Sequence

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

MOST_LINES = 3
"""Lines of a cell: it is folded twice."""

_GAP = 2
"""Blank columns between two cells."""

_LOG = 180
"""Columns of a pipe or a file, which have no edge, unless COLUMNS says otherwise."""


def console(*, stderr: bool = False) -> Console:
    """A console that is plain where its output is no terminal, and obeys COLUMNS."""
    made = Console(stderr=stderr, highlight=False)
    if not made.is_terminal and not os.environ.get("COLUMNS", "").isdigit():
        made.width = _LOG
    return made


def fitted(
    width: int,
    names: Sequence[str],
    rows: Sequence[Sequence[str | Text]],
    styles: Sequence[str | None],
    right: Sequence[bool],
    title: str = "",
) -> RenderableType:
    """A table of at most `width` columns.

    names: of the columns; a newline in one begins a new line of the head; columns without text are
    left out.  styles: of the rows.  right: whether a column is aligned at its right edge.
    """
    used = [j for j in range(len(names)) if j == 0 or any(_plain(row[j]) for row in rows)]
    names, rows = [names[j] for j in used], [[row[j] for j in used] for row in rows]
    right = [right[j] for j in used]
    cells = [[_plain(cell) for cell in row] for row in rows]
    least = [
        max([_least_width(name, len(name)) for name in name_of.split("\n")]
            + [_least_width(row[j], MOST_LINES) for row in cells])
        for j, name_of in enumerate(names)
    ]  # fmt: skip
    room = width - _GAP * (len(names) - 1)
    if sum(least) > room:
        return _records(names, rows, styles, title)
    natural = [
        max([len(part) for part in name.split("\n")] + [len(row[j]) for row in cells])
        for j, name in enumerate(names)
    ]
    table = Table(title=title or None, title_justify="left", box=None, pad_edge=False)
    table.padding = (0, _GAP, 0, 0)
    widths = _widths(least, natural, room)
    for name, columns, at_right in zip(names, widths, right, strict=True):
        justify = "right" if at_right else "left"
        table.add_column(name, width=columns, overflow="fold", justify=justify)  # type: ignore[arg-type]
    for row, style in zip(rows, styles, strict=True):
        table.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in row), style=style)
    return table


def _widths(least: Sequence[int], natural: Sequence[int], room: int) -> list[int]:
    """The width of each column: at least `least`; what is left goes to the most folded ones."""
    widths = [max(1, columns) for columns in least]
    while sum(widths) < room:
        missing = [want / have for have, want in zip(widths, natural, strict=True)]
        most = max(missing)
        if most <= 1.0:
            break
        widths[missing.index(most)] += 1
    return widths


def _records(
    names: Sequence[str],
    rows: Sequence[Sequence[str | Text]],
    styles: Sequence[str | None],
    title: str,
) -> Group:
    """Each row as lines: its first cell, then the others with their names."""
    lines = [Text(title, "italic")] if title else []
    for row, style in zip(rows, styles, strict=True):
        lines.append(Text(_plain(row[0]), style or "bold"))
        for name, cell in zip(names[1:], row[1:], strict=True):
            if _plain(cell):
                lines.append(Text.assemble(f"  {' '.join(name.split())}: ", cell))
    return Group(*lines)


def _least_width(text: str, lines: int) -> int:
    """The smallest width at which a text is wrapped to at most so many lines."""
    if not text:
        return 0
    low, high = 1, len(text)
    while low < high:
        middle = (low + high) // 2
        # No word is broken: it could not be searched for.
        wrapped = textwrap.wrap(text, middle, break_long_words=False, break_on_hyphens=False)
        fits = len(wrapped) <= lines and all(len(line) <= middle for line in wrapped)
        low, high = (low, middle) if fits else (middle + 1, high)
    return low


def _plain(cell: str | Text) -> str:
    return cell if isinstance(cell, str) else cell.plain
