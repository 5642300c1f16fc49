"""The times for people and machines: tables in a terminal, a page, `results.json` and
`results.csv`, which hold the same columns."""

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from markupsafe import Markup
from rich.console import RenderableType

from comparisons.experiments.methods.run import SERIES, Effort, Row, methods
from comparisons.report.plots import Curve, log_log
from comparisons.report.templates import template
from comparisons.report.templates import write as write_text
from comparisons.report.terminal import fitted
from comparisons.results.files import csv_file, write_json
from reference_rt.textbook import box, csg, polygon, sphere, triangle

SCHEMA = 2
"""Increased whenever a reader of the former layout would misread the new one."""

MEANING = {
    "x": "what `axis` says; null in a series of one setting",
    "ns": "nanoseconds per ray, one thread, warm: the median of `runs` runs",
    "ns_low": "lower quartile of the runs",
    "ns_high": "upper quartile",
    "timed": "rays of a run",
    "build_seconds": "to build the acceleration structure, the best of three",
}


def columns(row: Row) -> dict[str, Any]:
    """One row, flat: what both files hold."""
    time = row.time
    return {
        "family": row.family,
        "series": row.series,
        "x": row.x if row.axis else None,
        "axis": row.axis,
        "method": row.method,
        "ns": time.median,
        "ns_low": time.low,
        "ns_high": time.high,
        "runs": time.runs,
        "timed": time.rays,
        "build_seconds": row.build,
    }


def write(
    folder: Path, rows: Sequence[Row], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> None:
    """Both files, each whole or not at all.

    {"schema": 2, "provenance": {...}, "seed", "effort": {"rays", "runs"},
     "meaning": {column: what it is}, "rows": [{column: value}]}
    """
    flat = [columns(row) for row in rows]
    document = {
        "schema": SCHEMA,
        "provenance": dict(provenance),
        "seed": seed,
        "effort": effort._asdict(),
        "meaning": MEANING,
        "rows": flat,
    }
    write_json(folder / "results.json", document)
    with csv_file(folder / "results.csv") as file:
        writer = csv.DictWriter(file, list(flat[0]) if flat else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)


# ---- tables -------------------------------------------------------------------------------------


def table(rows: Sequence[Row], width: int) -> RenderableType:
    """Of one family, for a terminal of so many columns: a line for each method, a column for each
    setting, in nanoseconds per ray."""
    settings = _settings(rows)
    lines = [[short(name), *cells] for name, cells in _cells(rows, settings).items()]
    names = [f"{series}\n{x:g} {axis}" if axis else series for series, axis, x in settings]
    title = f"{rows[0].family}: ns per ray"
    return fitted(width, ["method", *names], lines, right=names, title=title)


def _settings(rows: Sequence[Row]) -> list[tuple[str, str, float]]:
    return list(dict.fromkeys((row.series, row.axis, row.x) for row in rows))


def _cells(rows: Sequence[Row], settings: Sequence[tuple[str, str, float]]) -> dict[str, list[str]]:
    found = {(row.method, row.series, row.axis, row.x): row.time.median for row in rows}
    names = dict.fromkeys(row.method for row in rows)
    return {name: [nanoseconds(found[name, *setting]) for setting in settings] for name in names}


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
}


# ---- the page -----------------------------------------------------------------------------------

_MODULES: dict[str, ModuleType] = {
    "sphere": sphere,
    "triangle": triangle,
    "box": box,
    "polygon": polygon,
    "csg": csg,
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
    known, settings = methods(name), _settings(rows)
    cells = _cells(rows, settings)
    return {
        "name": name,
        "settings": [f"{series}, {x:g} {axis}" if axis else series for series, axis, x in settings],
        "about": [f"{one.name}: {one.about}" for one in SERIES if one.family == name],
        "methods": [
            {
                "name": short(method),
                "summary": known[method].summary,
                "source": known[method].source,
                "cost": "",
                "fails": "",
                "cells": times,
                **stated(method),
            }
            for method, times in cells.items()
        ],
        "plots": [Markup(svg) for svg in _plots(rows)],  # our own, not from outside
    }


def _plots(rows: Sequence[Row]) -> list[str]:
    """Of each series of several settings: times against x, and those of building hierarchies."""
    plots = []
    for series, axis in dict.fromkeys((row.series, row.axis) for row in rows if row.axis):
        of = [row for row in rows if row.series == series]
        names = dict.fromkeys(row.method for row in of)
        by = {name: [row for row in of if row.method == name] for name in names}
        times = [_times(name, some) for name, some in by.items()]
        plots.append(log_log(times, axis, "ns per ray", series))
        built = {name: some for name, some in by.items() if some[0].build}
        if built:
            curves = [
                Curve(short(name), [r.x for r in some], [r.build or 0.0 for r in some])
                for name, some in built.items()
            ]
            plots.append(log_log(curves, axis, "seconds", f"{series}: to build"))
    return plots


def _times(method: str, rows: Sequence[Row]) -> Curve:
    low, median, high = ([getattr(r.time, q) for r in rows] for q in ("low", "median", "high"))
    return Curve(short(method), [r.x for r in rows], median, low, high)
