"""The tables of a family for a terminal."""

from collections.abc import Sequence

from rich.console import RenderableType

from comparisons.experiments.methods.run import Row
from comparisons.experiments.methods.summary import (
    Total,
    methods_of,
    of_method,
    series_of,
    short,
    total,
)
from comparisons.experiments.methods.wording import nanoseconds, percent, units, with_unit
from comparisons.report.terminal import fitted


def tables(rows: Sequence[Row], width: int) -> list[RenderableType]:
    """Tables of one family for a terminal of so many columns: its methods at ordinary and extreme
    settings, and the most extreme setting of each series."""
    return [_methods(rows, width), _series(rows, width)]


def _methods(rows: Sequence[Row], width: int) -> RenderableType:
    whats = ("ns/ray", "worst error, u", "wrong")
    names = [f"{kind}\n{what}" for kind in ("ordinary", "extreme") for what in whats]
    lines = []
    for method in methods_of(rows):
        cells = [short(method)]
        for extreme in (False, True):
            some = total(row for row in of_method(rows, method) if row.extreme == extreme)
            cells += _cells(some)
        lines.append(cells)
    return fitted(width, ["method", *names], lines, right=names, title=rows[0].family)


def _cells(some: Total | None) -> list[str]:
    if some is None:
        return ["–"] * 3
    return [nanoseconds(some.ns), units(some.worst), percent(some.share)]


def _series(rows: Sequence[Row], width: int) -> RenderableType:
    """At the last x of each series: the share of wrong answers; where that is zero, the worst
    error; where that is the same for all methods, the time."""
    methods, lines = methods_of(rows), []
    for series, some in series_of(rows).items():
        last = max(row.x for row in some)
        there = [row for method in methods for row in of_method(some, method) if row.x == last]
        same = len({row.errors.worst for row in there}) == 1
        x = f"{last:.0e}" if some[0].axis else ""
        lines.append([series, x, *(_end(row, same) for row in there)])
    names = ["x", *map(short, methods)]
    title = "most extreme setting of each series"
    return fitted(width, ["series", *names], lines, right=names, title=title)


def _end(row: Row, same_error: bool) -> str:
    wrong = row.errors.wrong - row.errors.ties
    if wrong:
        return f"{percent(wrong / row.errors.decided)} wrong"
    return with_unit(row.time.median) if same_error else f"{units(row.errors.worst)} u"
