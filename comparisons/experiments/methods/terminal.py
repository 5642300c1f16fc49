"""The tables of a family for a terminal."""

from collections.abc import Sequence

from rich.table import Table

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


def tables(rows: Sequence[Row]) -> list[Table]:
    """Tables of one family: its methods at ordinary and extreme settings, and the most extreme
    setting of each series."""
    return [_methods(rows), _series(rows)]


def _methods(rows: Sequence[Row]) -> Table:
    table = Table(title=rows[0].family, title_justify="left", box=None)
    table.add_column("method")
    for kind in ("ordinary", "extreme"):
        for what in ("ns/ray", "worst error, u", "wrong"):
            table.add_column(f"{kind}\n{what}", justify="right")
    for method in methods_of(rows):
        cells = [short(method)]
        for extreme in (False, True):
            some = total(row for row in of_method(rows, method) if row.extreme == extreme)
            cells += _cells(some)
        table.add_row(*cells)
    return table


def _cells(some: Total | None) -> list[str]:
    if some is None:
        return ["–"] * 3
    return [nanoseconds(some.ns), units(some.worst), percent(some.share)]


def _series(rows: Sequence[Row]) -> Table:
    """At the last x of each series: the share of wrong answers; where that is zero, the worst
    error; where that is the same for all methods, the time."""
    table = Table(title="most extreme setting of each series", title_justify="left", box=None)
    table.add_column("series")
    table.add_column("x", justify="right")
    names = methods_of(rows)
    for method in names:
        table.add_column(short(method), justify="right")
    for series, some in series_of(rows).items():
        last = max(row.x for row in some)
        there = [row for method in names for row in of_method(some, method) if row.x == last]
        same = len({row.errors.worst for row in there}) == 1
        x = f"{last:.0e}" if some[0].axis else ""
        table.add_row(series, x, *(_end(row, same) for row in there))
    return table


def _end(row: Row, same_error: bool) -> str:
    wrong = row.errors.wrong - row.errors.ties
    if wrong:
        return f"{percent(wrong / row.errors.decided)} wrong"
    return with_unit(row.time.median) if same_error else f"{units(row.errors.worst)} u"
