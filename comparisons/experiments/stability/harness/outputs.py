"""What a run shows: progress, the table of all series, JSON, CSV, and the page."""

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

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
from comparisons.experiments.stability.harness.series import Effort, family
from comparisons.report.table import Column, Table
from comparisons.report.values import label, power_of_ten, shown, typeset
from comparisons.results.files import plain, write_json
from comparisons.runs.engine import Count

# ---- the table of all series, for a terminal and as Markdown -------------------------------------


class Line(NamedTuple):
    """A series of a family, which has this id."""

    family: str
    one: SeriesSummary

    @property
    def cases(self) -> str:
        """Of ours."""
        ours = total(self.one.found, OURS)
        return "–" if ours is None else f"{ours.cases:,}"

    @property
    def failures(self) -> str:
        """Of ours."""
        ours = total(self.one.found, OURS)
        return "not measured" if ours is None else f"{ours.failures:,}"

    @property
    def last(self) -> str:
        """Its most extreme x."""
        axis = self.one.series.axis
        return f"{axis} {number(self.one.last)}" if axis else ""

    @property
    def others(self) -> str:
        """Where each contestant besides ours and Mitsuba starts to fail."""
        names: dict[str, list[str]] = {}
        for c in contestants(self.one.found):
            if c not in (OURS, MITSUBA):
                names.setdefault(where(self.one, c), []).append(named(c))
        return "; ".join(f"{', '.join(some)}: {place}" for place, some in names.items())


_FAMILY = Column[Line]("family", lambda line: f"{line.family} {family(line.family).name}")
_SERIES = Column[Line]("series", lambda line: label(line.one.series.name))
_TO = Column[Line]("to", lambda line: line.last, look="more")
_CASES = Column[Line]("cases", lambda line: line.cases, right=True, look="count more")
_FAILURES = Column[Line]("failures", lambda line: line.failures, look="count more")
_PLACES = (
    Column[Line]("worst", lambda line: worst(line.one, OURS), look="more"),
    Column[Line]("ours", lambda line: where(line.one, OURS)),
    Column[Line]("Mitsuba", lambda line: where(line.one, MITSUBA)),
    Column[Line]("others", lambda line: line.others),
)
COLUMNS = (_SERIES, _TO, _CASES, _FAILURES, *_PLACES)
"""Of a family's series.  The look "more" is left out on small screens."""


def series_table(columns: Sequence[Column[Line]], found: Sequence[Found]) -> Table[Line]:
    lines = [Line(name, one) for name, series in summaries(found).items() for one in series]
    return Table(columns, lines, lambda line: "" if line.one.holds else "failed")


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
    series = replace(_SERIES, of=lambda line: f"{line.family} {label(line.one.series.name)}")
    # Without failures: the others say where each fails.
    return series_table((series, _TO, _CASES, *_PLACES), found).terminal(width)


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
    return "\n".join([*lines, *series_table((_FAMILY, *COLUMNS), found).markdown()]) + "\n"


# ---- for machines: `results.json` and `results.csv` ----------------------------------------------


SCHEMA = 1
"""Raised whenever a reader of the former layout would misread the new one."""


class Row(NamedTuple):
    """A contestant at one setting;  is_first: of the contestants there."""

    found: Found
    contestant: str
    is_first: bool

    @property
    def outcome(self) -> Outcome:
        return self.found.outcomes[self.contestant]

    @property
    def worst(self) -> float | str | None:
        """The outcome's; "inf" for infinity, which JSON has no number for."""
        return plain(self.outcome.worst, str)  # type: ignore[no-any-return]


def rows_of(found: Sequence[Found], axis: str = "", unit: str = "") -> Table[Row]:
    """Of `results.csv`, and of the page, where a series has an axis and a unit."""
    unit = f", {typeset(unit)}" if unit else ""
    columns = (
        Column[Row](None, lambda row: row.found.family, key="family"),
        Column[Row](None, lambda row: row.found.series, key="series"),
        Column[Row](typeset(axis) or None, lambda row: row.found.x, number, key="x"),
        Column[Row]("method", lambda row: row.contestant, named, key="contestant"),
        Column[Row]("cases", lambda row: row.outcome.cases, shown, key="cases"),
        Column[Row]("failures", lambda row: row.outcome.failures, shown, key="failures"),
        Column[Row](f"worst error{unit}", lambda row: row.worst, _worst, key="worst"),
        Column[Row]("undecidable", lambda row: row.outcome.open, shown, key="open"),
        Column[Row]("seconds", lambda row: f"{row.found.seconds:.1f}" if row.is_first else ""),
    )
    rows = [Row(f, name, k == 0) for f in found for k, name in enumerate(contestants([f]))]
    return Table(columns, rows, lambda row: "first" if row.is_first else "")


def _worst(error: float | str | None) -> str:
    return "–" if error is None else number(float(error))


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
    rows_of(found).write_csv(folder / "results.csv")


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
