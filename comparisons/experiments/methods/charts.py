"""The plots of a family and of each series."""

from collections.abc import Callable, Sequence

import numpy as np

from comparisons.experiments.methods.run import Row
from comparisons.experiments.methods.summary import methods_of, of_method, short
from comparisons.experiments.methods.wording import QUIET
from comparisons.report.plots import Curve, log_log

FLOOR = 0.1
"""Errors below this, in u, are drawn here, because a logarithmic axis has no zero."""

VARIES = 1.3
"""Times are drawn against x where they change by at least this factor."""

WIDE, NARROW = (5.2, 4.0), (4.6, 3.6)
"""Inches."""

ERROR = "error, u (|t| + size)"
RELATIVE = "error, u |t|"
TIME = "ns per ray and shape"


def of_family(rows: Sequence[Row]) -> list[str]:
    """Worst errors and wrong answers against nanoseconds: a point for each method and setting,
    ordinary ones and extreme ones."""
    plots = []
    for extreme, title in ((False, "ordinary settings"), (True, "extreme settings")):
        some = [row for row in rows if row.extreme == extreme and not row.relative]
        if any(row.errors.worst is not None for row in some):
            curves = _points(some, rows, lambda row: max(row.errors.worst or 0.0, FLOOR))
            plots.append(log_log(curves, TIME, f"worst {ERROR}", title.capitalize(), size=WIDE))
    wrong = [row for row in rows if row.extreme]
    if any(_surely(row) for row in wrong):
        least = _least(wrong)
        curves = _points(wrong, rows, lambda row: max(_surely(row), least))
        level = {"none seen": least}
        title = "Extreme settings: share of wrong answers"
        plots.append(log_log(curves, TIME, "share of rays", title, level, WIDE))
    return plots


def _points(some: Sequence[Row], every: Sequence[Row], y: Callable[[Row], float]) -> list[Curve]:
    """Points without lines; a method has the same colour in all plots."""
    curves = []
    for number, method in enumerate(methods_of(every)):
        for place, row in enumerate(of_method(some, method)):
            name = short(method) if place == 0 else ""
            curves.append(Curve(name, [row.time.median], [y(row)], colour=number))
    return curves


def of_series(rows: Sequence[Row]) -> list[str]:
    """Plots against x: errors unless all are small, wrong answers if there are any, times if they
    change."""
    if not rows[0].axis:
        return []
    axis, plots = rows[0].axis, []
    if any((row.errors.worst or 0.0) > QUIET for row in rows):
        what = RELATIVE if rows[0].relative else ERROR
        curves = [
            curve
            for number, method in enumerate(methods_of(rows))
            for curve in _errors(of_method(rows, method), number)
        ]
        title = "Worst error; dashed: the median"
        plots.append(log_log(curves, axis, what, title, size=NARROW))
    if any(_surely(row) for row in rows):
        least = _least(rows)
        curves = [
            _shares(of_method(rows, method), number, least)
            for number, method in enumerate(methods_of(rows))
        ]
        level = {"none seen": least}
        plots.append(log_log(curves, axis, "share of rays", "Wrong answers", level, NARROW))
    if any(_varies(of_method(rows, method)) for method in methods_of(rows)):
        curves = [
            _times(of_method(rows, method), number)
            for number, method in enumerate(methods_of(rows))
        ]
        plots.append(log_log(curves, axis, TIME, "Time", size=NARROW))
    return plots


def _errors(rows: Sequence[Row], colour: int) -> list[Curve]:
    some = [row for row in rows if row.errors.worst is not None]
    x = [row.x for row in some]
    worst = [max(row.errors.worst or 0.0, FLOOR) for row in some]
    median = [max(row.errors.median or 0.0, FLOOR) for row in some]
    name = short(rows[0].method)
    return [
        Curve(name, x, worst, colour=colour),
        Curve("", x, median, dashed=True, colour=colour, marked=False),
    ]


def _shares(rows: Sequence[Row], colour: int, least: float) -> Curve:
    x = [row.x for row in rows]
    y = [max(_surely(row), least) for row in rows]
    return Curve(short(rows[0].method), x, y, colour=colour)


def _times(rows: Sequence[Row], colour: int) -> Curve:
    x = [row.x for row in rows]
    low, median, high = ([getattr(row.time, part) for row in rows] for part in _QUARTILES)
    return Curve(short(rows[0].method), x, median, low, high, colour=colour)


_QUARTILES = ("low", "median", "high")


def _varies(rows: Sequence[Row]) -> bool:
    times = [row.time.median for row in rows]
    return bool(max(times) > VARIES * min(times))


def _surely(row: Row) -> float:
    """The share of wrong answers, without ties."""
    return (row.errors.wrong - row.errors.ties) / max(row.errors.decided, 1)


def _least(rows: Sequence[Row]) -> float:
    """Where a share of zero is drawn: at half a ray."""
    return 0.5 / float(np.max([row.errors.decided for row in rows]))
