"""What a run shows: progress, the table of all series, JSON, CSV, and the page."""

import base64
import csv
import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
from rich.console import RenderableType

from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, Outcome
from comparisons.experiments.stability.harness.points import (
    Found,
    SeriesSummary,
    contestants,
    first_failure,
    found_of,
    named,
    summaries,
    summarise,
    total,
)
from comparisons.experiments.stability.harness.run import Picture
from comparisons.experiments.stability.harness.series import Effort, family
from comparisons.report.plots import Curve, log_log
from comparisons.report.templates import template, write
from comparisons.report.terminal import fitted
from comparisons.report.values import label, power_of_ten, typeset
from comparisons.results.files import csv_file, plain, write_json
from comparisons.runs.engine import Count

# ---- the table of all series, for a terminal and as Markdown -------------------------------------


COLUMNS = ("family", "series", "to", "cases", "failures", "worst", "ours", "Mitsuba", "others")


def cells(name: str, one: SeriesSummary) -> list[str]:
    """Of one series, as text."""
    ours = total(one.found, OURS)
    others = [c for c in contestants(one.found) if c not in (OURS, MITSUBA)]
    shown: dict[str, list[str]] = {}
    for c in others:
        shown.setdefault(where(one, c), []).append(named(c))
    return [
        f"{name} {family(name).name}",
        label(one.series.name),
        f"{one.series.axis} {number(one.last)}" if one.series.axis else "",
        f"{ours.cases:,}" if ours else "–",
        f"{ours.failures:,}" if ours else "not measured",
        worst(one, OURS),
        where(one, OURS),
        where(one, MITSUBA),
        "; ".join(f"{', '.join(names)}: {found}" for found, names in shown.items()),
    ]


def where(one: SeriesSummary, contestant: str) -> str:
    """At which x a contestant starts to fail; of ours whether that is where float64 ends."""
    some = total(one.found, contestant)
    if some is None:
        return "–"
    if not some.failures:
        return "holds"
    share = f"{some.failures:,} of {some.cases:,}"
    x = first_failure(one.found, contestant)
    assert x is not None
    if contestant == OURS and one.holds:
        return f"holds to float64's end, {number(one.series.holds_to)}"
    return f"fails from {number(x)} on" if one.series.axis else share


def worst(one: SeriesSummary, contestant: str) -> str:
    """The largest error, with its unit."""
    some = total(one.found, contestant)
    if some is None or some.worst is None:
        return "–"
    return f"{number(some.worst)} {one.series.unit}".rstrip()


def number(value: float) -> str:
    """Two digits, powers of ten as such."""
    if value == 0.0 or math.isinf(value):
        return "0" if value == 0.0 else "∞"
    if 1e-3 <= value < 1e4:
        return f"{value:.2g}" if value < 100.0 else f"{value:,.0f}"
    return power_of_ten(value)


def terminal(found: Sequence[Found], width: int) -> RenderableType:
    """For people at a terminal of so many columns."""
    names = [name for name in COLUMNS if name != "failures"]  # the others say where each fails
    rows, styles = [], []
    for name, series in summaries(found).items():
        for one in series:
            _, series_name, to, cases, _, *rest = cells(name, one)
            rows.append((f"{name} {series_name}", to, cases, *rest))
            styles.append(None if one.holds else "bold red")
    return fitted(width, names[1:], rows, styles=styles, right=("cases",))


def markdown(
    found: Sequence[Found], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> str:
    """The table with its date and machine, for docs/results/stability.md."""
    shown = [
        f"`reference-rt stability --{effort} --seed {seed}`",
        str(provenance["date"])[:10],
        str(provenance["machine"]),
        f"{provenance['cores']} cores",
        f"Mitsuba {provenance.get('mitsuba', 'absent')}".partition(":")[0],
        f"{sum(f.seconds for f in found) / 60.0:.0f} minutes of one process",
    ]
    lines = ["Measured: " + ", ".join(shown) + ".", ""]
    lines += ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    for name, series in summaries(found).items():
        for one in series:
            row = [cell.replace("|", "\\|") for cell in cells(name, one)]
            lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"


# ---- for machines: `results.json` and `results.csv` ----------------------------------------------


SCHEMA = 1
"""Raised whenever a reader of the former layout would misread the new one."""

CSV = ("family", "series", "x", "contestant", "cases", "failures", "worst", "open")
"""Of `results.csv`."""

MEANING = {
    "cases": "put to a contestant and decided",
    "failures": "cases that break the law",
    "open": "cases that the arbiter leaves open: rays that touch exactly, say",
    "worst": "the largest error in the series' unit, null where there is none, 'inf' for infinite;"
    " of a family that of its first series",
    "limit_ours": "the smallest x at which ours failed, null where it did not; of a family that of"
    " its first series",
    "limit_mitsuba": "the same of Mitsuba; null too where it took no part",
    "holds_to": "ours must not fail up to this x, null for all; `law` says why it ends",
    "holds": "whether ours held as far as it must",
    "further": "how many times further ours holds than Mitsuba, at least",
    "again": "the command that measures this setting alone",
}


def again(found: Found, effort: Effort, seed: int) -> str:
    """The command that measures a setting alone."""
    command = ["reference-rt", "stability", "--family", found.family, "--series", found.series]
    command += ["--at", repr(found.x), "--seed", str(seed), f"--{effort}", "--fresh"]
    return shlex.join(command)


def write_results(
    folder: Path, found: Sequence[Found], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> None:
    """Both files, each whole or not at all."""
    document = {
        "schema": SCHEMA,
        "kind": "stability",
        "provenance": dict(provenance),
        "seed": seed,
        "effort": effort,
        "meaning": MEANING,
        "families": [
            _family(name, found_of(found, name), effort, seed)
            for name in dict.fromkeys(f.family for f in found)
        ],
    }
    write_json(folder / "results.json", document)
    with csv_file(folder / "results.csv") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(CSV)
        for f in found:
            for name, some in f.outcomes.items():
                row = _flat(some)
                writer.writerow((f.family, f.series, repr(f.x), name, *row.values()))


def _family(name: str, found: Sequence[Found], effort: Effort, seed: int) -> dict[str, Any]:
    definition = family(name)
    series = summarise(definition, found)
    head = series[0]
    return {
        "id": name,
        "name": definition.name,
        "law": definition.law,
        "cases": getattr(total(found, OURS), "cases", 0),
        "ours": _side(found, head, OURS),
        "mitsuba": _side(found, head, MITSUBA),
        "limit_ours": head.ours,
        "limit_mitsuba": head.mitsuba,
        "holds": all(one.holds for one in series),
        "series": [_series_json(one, effort, seed) for one in series],
    }


def _side(found: Sequence[Found], head: SeriesSummary, name: str) -> dict[str, Any] | None:
    everything, first = total(found, name), total(head.found, name)
    if everything is None:
        return None
    worst = None if first is None else first.worst
    return {"cases": everything.cases, "failures": everything.failures, "worst": plain(worst, str)}


def _series_json(one: SeriesSummary, effort: Effort, seed: int) -> dict[str, Any]:
    series = one.series
    return {
        "name": series.name,
        "axis": series.axis,
        "about": series.about,
        "unit": series.unit,
        "holds_to": None if math.isinf(series.holds_to) else series.holds_to,
        "law": series.law,
        "explained": series.explained,
        "limit_ours": one.ours,
        "limit_mitsuba": one.mitsuba,
        "last": one.last,
        "further": one.further,
        "holds": one.holds,
        "settings": [
            {
                "x": f.x,
                "seconds": f.seconds,
                "broken": f.broken,
                "again": again(f, effort, seed),
                "outcomes": {
                    name: _flat(f.outcomes[name])
                    | {"examples": plain(f.outcomes[name].examples, str)}
                    for name in contestants([f])
                },
            }
            for f in one.found
        ],
    }


def _flat(some: Outcome) -> dict[str, Any]:
    return {
        "cases": some.cases,
        "failures": some.failures,
        "worst": plain(some.worst, str),
        "open": some.open,
    }


# ---- the page: a single file that needs no network and runs no script ----------------------------


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


_LOOKS = ("", "more", "count more", "count more", "more", "", "", "")
"""CSS classes of the table's columns after the family: "more" is left out on small screens."""


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
    held = f"in {sum(one.holds for one in series)} of {len(series)}" if series else "in no"
    page = template("stability.html.jinja", folder, number=number, named=named).render(
        provenance={**provenance, "effort": effort, "seed": seed},
        verdict=f"Ours holds as far as it must {held} series",
        columns=list(zip(COLUMNS[1:], _LOOKS, strict=True)),
        families=[
            {
                "definition": family(name),
                "series": [_series(name, one, pictures, effort, seed) for one in series],
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
        "cells": cells(name, one)[1:],
        "definition": one.series,
        "plots": [Markup(svg) for svg in of_series(one)],  # our own, not from outside
        "pictures": [
            (p.contestant, p.x, _url(p.path), p.caption)
            for p in pictures
            if (p.family, p.series) == (name, one.series.name)
        ],
        "rows": [
            (f, contestant, f.outcomes[contestant], k == 0)
            for f in one.found
            for k, contestant in enumerate(contestants([f]))
        ],
        "failures": [
            (f, contestant, f.outcomes[contestant].examples, again(f, effort, seed))
            for f in one.found
            for contestant in contestants([f])
            if f.outcomes[contestant].examples
        ],
    }


def _url(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()


# ---- progress ------------------------------------------------------------------------------------


class Display(Count):
    """The bar."""

    def done(self, found: Found, remark: str) -> None:
        """Count a point; failures of ours are printed, and without a terminal everything."""
        self.count(f"{found.family} {found.series}")
        bad = found.broken or (found.ours is not None and found.ours.failures)
        if bad or not self.is_terminal:
            self.line(f"{found.family} {found.series} {found.x:g}: {said(found)} ({remark})")


def said(found: Found) -> str:
    """The outcomes of a point in a line."""
    if found.broken:
        return f"not measured: {found.broken}"
    shown = []
    for name in sorted(found.outcomes, key=lambda n: (n != OURS, n != MITSUBA, n)):
        some = found.outcomes[name]
        worst = "" if some.worst is None else f", worst {some.worst:.2g}"
        shown.append(f"{name} {some.failures:,} of {some.cases:,}{worst}")
    return "; ".join(shown)
