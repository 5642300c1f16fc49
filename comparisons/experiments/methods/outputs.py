"""The times for people and machines: tables in a terminal, a page, `results.json` and
`results.csv`, which hold the same columns."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from markupsafe import Markup
from rich.console import Group, RenderableType

from comparisons.experiments.methods.run import SERIES, Effort, Row, methods
from comparisons.report.plots import Curve, log_log
from comparisons.report.table import Cell, Column, Table
from comparisons.report.templates import template
from comparisons.report.templates import write as write_text
from comparisons.results.files import write_json
from reference_rt.textbook import box, csg, picture, polygon, sphere, triangle

SCHEMA = 2
"""Increased whenever a reader of the former layout would misread the new one."""

MEANING = {
    "x": "what `axis` says; null in a series of one setting",
    "ns": "nanoseconds per ray, one thread, warm: the median of `runs` runs",
    "ns_low": "lower quartile of the runs",
    "ns_high": "upper quartile",
    "timed": "rays of a run",
    "build_seconds": "to build the acceleration structure, the best of three",
    "error": "of the barycentrics, against rational arithmetic: median, in roundings of 2^-53",
}


COLUMNS = tuple(
    Column[Row](None, of, key=key)
    for key, of in (
        ("family", lambda row: row.family),
        ("series", lambda row: row.series),
        ("x", lambda row: row.x if row.axis else None),
        ("axis", lambda row: row.axis),
        ("method", lambda row: row.method),
        ("ns", lambda row: row.time.median),
        ("ns_low", lambda row: row.time.low),
        ("ns_high", lambda row: row.time.high),
        ("runs", lambda row: row.time.runs),
        ("timed", lambda row: row.time.rays),
        ("build_seconds", lambda row: row.build),
        ("error", lambda row: row.error),
    )
)
"""Of both files."""


def write(
    folder: Path, rows: Sequence[Row], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> None:
    """Both files, each whole or not at all.

    {"schema": 2, "provenance": {...}, "seed", "effort": {"rays", "runs"},
     "meaning": {column: what it is}, "rows": [{column: value}]}
    """
    table = Table(COLUMNS, rows)
    document = {
        "schema": SCHEMA,
        "provenance": dict(provenance),
        "seed": seed,
        "effort": effort._asdict(),
        "meaning": MEANING,
        "rows": table.records(),
    }
    write_json(folder / "results.json", document)
    table.write_csv(folder / "results.csv")


# ---- tables -------------------------------------------------------------------------------------


def terminal(rows: Sequence[Row], width: int) -> RenderableType:
    """Of one family, for a terminal of so many columns."""
    name, family = Column[str]("method", short), rows[0].family
    times = _table(rows, name, between="\n").terminal(width, f"{family}: ns per ray")
    inexact = _errors(rows)
    return Group(times, *(e.terminal(width, f"{family}: {ERRORS}") for e in inexact))


ERRORS = "errors of barycentrics, in roundings of 2^-53"


def _errors(rows: Sequence[Row]) -> list[Table[str]]:
    """Of one family: one table, or none."""
    of = {(row.method, row.x): row.error for row in rows if row.error is not None}
    if not of:
        return []
    axis = next(row.axis for row in rows if row.error is not None)

    def setting(x: float) -> Column[str]:
        return Column(f"{axis} {x:g}", lambda name: f"{of[name, x]:.2g}", right=True)

    columns = (Column[str]("method", short), *map(setting, dict.fromkeys(x for _, x in of)))
    return [Table(columns, list(dict.fromkeys(method for method, _ in of)))]


def _table(rows: Sequence[Row], *first: Column[str], between: str) -> Table[str]:
    """Of one family: a row for each method, and below its columns those of the settings, in
    nanoseconds per ray;  between: what stands between a setting's series and its x."""
    times = {(row.method, row.series, row.x): row.time.median for row in rows}

    def setting(series: str, axis: str, x: float) -> Column[str]:
        name = f"{series}{between}{x:g} {axis}" if axis else series
        return Column(name, lambda method: times[method, series, x], nanoseconds, right=True)

    settings = dict.fromkeys((row.series, row.axis, row.x) for row in rows)
    columns = (*first, *(setting(*each) for each in settings))
    return Table(columns, list(dict.fromkeys(row.method for row in rows)))


def nanoseconds(value: float) -> str:
    """A time with three digits; without a unit it is nanoseconds."""
    if value >= 1e6:
        return f"{value / 1e6:.3g} ms"
    if value >= 1e4:
        return f"{value / 1e3:.3g} µs"
    return f"{value:.3g}" if value < 1000.0 else f"{value:,.0f}"


def short(method: str) -> str:
    """A method's name for people, without its family: "Möller-Trumbore"."""
    name = method.partition(".")[2]
    return _SPELT.get(name, name.replace("_", " "))


_SPELT = {
    "cramer": "Cramer",
    "even_odd": "even-odd",
    "lu": "LU",
    "moller_trumbore": "Möller-Trumbore",
    "sah": "SAH",
    "slabs_ieee": "IEEE slabs",
    "slabs_parallel_test": "slabs",
    "slabs_unrolled": "IEEE slabs, unrolled",
}


# ---- the page -----------------------------------------------------------------------------------

_MODULES: dict[str, ModuleType] = {
    "sphere": sphere,
    "triangle": triangle,
    "box": box,
    "polygon": polygon,
    "csg": csg,
    "picture": picture,
}
"""By family; acceleration structures share one kernel, whose docstring counts no operations."""


def stated(method: str) -> dict[str, str]:
    """{"cost": "13 +, 16 *, 2 /, 1 sqrt", "fails": ...}, as far as its docstring says so."""
    family, _, name = method.partition(".")
    function = getattr(_MODULES.get(family), name, None)
    text = " ".join((getattr(function, "__doc__", None) or "").split())
    found = {}
    for what, pattern in (("cost", r"Cost: (.*?)\.(?: |$)"), ("fails", r"Fails: (.*)$")):
        if match := re.search(pattern, text):
            found[what] = match[1].replace("`", "").replace(" * ", " × ").replace(" *", " ×")
    return found


def write_page(
    path: Path, rows: Sequence[Row], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> None:
    """Write the page about `rows`, at once or not at all."""
    names = dict.fromkeys(row.family for row in rows)
    families = [_family(name, [row for row in rows if row.family == name]) for name in names]
    page = template("methods.html.jinja", "experiments/methods").render(
        provenance=provenance,
        effort=effort,
        seed=seed,
        families=sorted(families, key=lambda family: not family["plots"]),  # charts first
    )
    write_text(path, page)


def _family(name: str, rows: Sequence[Row]) -> dict[str, Any]:
    known = methods(name)

    def described(method: str) -> Cell:
        return Cell(short(method), f"{known[method].summary}. {known[method].source}")

    method = Column[str]("method", described)
    operations = Column[str](
        "operations", lambda name: stated(name).get("cost", "–"), look="text more"
    )
    table = _table(rows, method, operations, between=", ")
    fails = {short(each): stated(each).get("fails") for each in table.rows}
    return {
        "name": name,
        "about": [f"{one.name}: {one.about}" for one in SERIES if one.family == name],
        "table": table,
        "errors": _errors(rows),
        "fails": {each: how for each, how in fails.items() if how},
        "plots": [Markup(svg) for svg in _plots(rows)],  # our own, not from outside
    }


def _plots(rows: Sequence[Row]) -> list[str]:
    """Of each series of several settings: times against x, those of building hierarchies, and
    errors."""
    plots = []
    for series, axis in dict.fromkeys((row.series, row.axis) for row in rows if row.axis):
        of = [row for row in rows if row.series == series]
        names = dict.fromkeys(row.method for row in of)
        by = {name: [row for row in of if row.method == name] for name in names}
        times = [_times(name, some) for name, some in by.items()]
        plots.append(log_log(times, axis, "ns per ray", series))
        for field, unit, what in (
            ("build", "seconds", "to build"),
            ("error", "roundings", "errors of barycentrics"),
        ):
            curves = [
                Curve(short(name), [r.x for r in some], [getattr(r, field) for r in some])
                for name, some in by.items()
                if getattr(some[0], field) is not None
            ]
            if curves:
                plots.append(log_log(curves, axis, unit, f"{series}: {what}"))
    return plots


def _times(method: str, rows: Sequence[Row]) -> Curve:
    low, median, high = ([getattr(r.time, q) for r in rows] for q in ("low", "median", "high"))
    return Curve(short(method), [r.x for r in rows], median, low, high)
