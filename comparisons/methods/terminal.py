"""The tables of a family for a terminal."""

from collections.abc import Sequence

from rich.table import Table

from comparisons.methods.run import Row
from comparisons.methods.summary import Total, methods_of, of_method, series_of, short, total
from comparisons.methods.wording import nanoseconds, percent, units


def tables(rows: Sequence[Row]) -> list[Table]:
    """Of one family: its methods at ordinary and extreme settings, and where each series ends."""
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
    """Wrong answers at the last x of each series, or where there are none the worst error."""
    table = Table(title="at the far end of each series", title_justify="left", box=None)
    table.add_column("series")
    table.add_column("x", justify="right")
    names = methods_of(rows)
    for method in names:
        table.add_column(short(method), justify="right")
    for series, some in series_of(rows).items():
        last = max(row.x for row in some)
        cells = []
        for method in names:
            (row,) = (r for r in some if r.method == method and r.x == last)
            wrong = row.errors.wrong - row.errors.ties
            share = wrong / max(row.errors.decided, 1)
            cells.append(f"{percent(share)} wrong" if wrong else units(row.errors.worst) + " u")
        table.add_row(series, f"{last:.0e}" if some[0].axis else "", *cells)
    return table
