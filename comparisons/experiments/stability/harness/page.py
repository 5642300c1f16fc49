"""The page: a single file that needs no network and runs no script; and its plots."""

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from markupsafe import Markup

from comparisons.experiments.stability.harness.outputs import (
    COLUMNS,
    again,
    number,
    rows_of,
    series_table,
)
from comparisons.experiments.stability.harness.points import (
    Found,
    SeriesSummary,
    contestants,
    found_of,
    named,
    summaries,
)
from comparisons.experiments.stability.harness.run import Picture
from comparisons.experiments.stability.harness.series import Effort, family
from comparisons.report.plots import Curve, log_log
from comparisons.report.templates import template, write
from comparisons.report.values import typeset

SIZE = (4.8, 3.7)
"""Inches."""

LEAST, MOST = 1e-2, 1e30
"""Limits of the axis of worst errors, in the series' unit: a logarithmic axis has no zero, and
where a textbook's 1 - R gives 1e-16 in place of 0, the error is some 1e297."""


def of_series(one: SeriesSummary) -> list[str]:
    """SVG plots; none where there is one point alone, or no failure and no error."""
    if not one.series.axis or len(one.found) < 2:
        return []
    names = contestants(one.found)
    ends = {}
    if not math.isinf(one.series.holds_to):
        ends["float64 ends"] = one.series.holds_to
    plots = []
    axis = typeset(one.series.axis)
    if _any_fails(one):
        seen = _least(one)
        curves = [_rates(one, name, k) for k, name in enumerate(names)]
        level = {"none seen": seen}
        plots.append(log_log(curves, axis, "share of cases", "Failures", level, SIZE, ends))
    if any(some.worst is not None for f in one.found for some in f.outcomes.values()):
        curves = [_errors(one, name, k) for k, name in enumerate(names)]
        plots.append(log_log(curves, axis, _error(one), "Worst error", None, SIZE, ends))
    return plots


def failures(found: Sequence[Found]) -> dict[str, str]:
    """The plots of failures of all series that somebody fails, by name."""
    return {
        f"{name}-{one.series.name}": plots[0]
        for name, series in summaries(found).items()
        for one in series
        if _any_fails(one) and (plots := of_series(one))
    }


def _any_fails(one: SeriesSummary) -> bool:
    return any(some.failures for f in one.found for some in f.outcomes.values())


def _error(one: SeriesSummary) -> str:
    """What the axis of errors shows: "error / the law's bound"."""
    unit = typeset(one.series.unit) or "error"
    return f"error / {unit.removeprefix('of ')}" if unit.startswith("of ") else unit


def _rates(one: SeriesSummary, name: str, colour: int) -> Curve:
    some = [(f.x, f.outcomes[name]) for f in one.found if name in f.outcomes]
    y = [max(o.failures / max(o.cases, 1), _least(one)) for _, o in some]
    return Curve(named(name), [x for x, _ in some], y, colour=colour)


def _least(one: SeriesSummary) -> float:
    """The rate at which no failure is drawn: half a case of the most cases of any point."""
    return 0.5 / max(1, *(some.cases for f in one.found for some in f.outcomes.values()))


def _errors(one: SeriesSummary, name: str, colour: int) -> Curve:
    some = [(f.x, f.outcomes[name].worst) for f in one.found if name in f.outcomes]
    known = [(x, worst) for x, worst in some if worst is not None and math.isfinite(worst)]
    shown = [min(max(worst, LEAST), MOST) for _, worst in known]
    return Curve(named(name), [x for x, _ in known], shown, colour=colour)


def write_page(
    path: Path,
    found: Sequence[Found],
    pictures: Sequence[Picture],
    effort: Effort,
    seed: int,
    provenance: Mapping[str, Any],
) -> None:
    """Write the page, at once or not at all; all text is escaped."""
    folder = "experiments/stability"
    series = [one for some in summaries(found).values() for one in some]
    columns = [replace(column, text=typeset) for column in COLUMNS]
    held = f"in {sum(one.holds for one in series)} of {len(series)}" if series else "in no"
    page = template("stability.html.jinja", folder, number=number, named=named).render(
        provenance={**provenance, "effort": effort, "seed": seed},
        verdict=f"Ours holds as far as it must {held} series",
        columns=columns,
        families=[
            {
                "definition": family(name),
                "series": [_series(name, one, pictures, effort, seed) for one in series],
                "table": series_table(columns, found_of(found, name)),
            }
            for name, series in summaries(found).items()
        ],
    )
    write(path, page)


def _series(
    name: str, one: SeriesSummary, pictures: Sequence[Picture], effort: Effort, seed: int
) -> dict[str, Any]:
    return {
        "summary": one,
        "definition": one.series,
        "plots": [Markup(svg) for svg in of_series(one)],  # our own, not from outside
        "pictures": [
            (p.contestant, p.x, _url(p.path), p.caption)
            for p in pictures
            if (p.family, p.series) == (name, one.series.name)
        ],
        "table": rows_of(one.found, one.series.axis, one.series.unit),
        "failures": [
            (f, contestant, f.outcomes[contestant].examples, again(f, effort, seed))
            for f in one.found
            for contestant in contestants([f])
            if f.outcomes[contestant].examples
        ],
    }


def _url(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()
