"""One page about the families: a single file that needs no network and runs no script."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from comparisons.experiments.stability.harness import charts, table
from comparisons.experiments.stability.harness.core import Effort
from comparisons.experiments.stability.harness.families import family
from comparisons.experiments.stability.harness.result import Found
from comparisons.experiments.stability.harness.results_json import again
from comparisons.experiments.stability.harness.run import Picture
from comparisons.experiments.stability.harness.summary import (
    SeriesSummary,
    contestants,
    named,
)
from comparisons.report.templates import template, write

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
    page = template("stability.html.jinja", folder, number=table.number, named=named).render(
        provenance={**provenance, "effort": effort, "seed": seed},
        columns=list(zip(table.COLUMNS[1:], _LOOKS, strict=True)),
        families=[
            {
                "definition": family(name),
                "series": [_series(name, one, pictures, effort, seed) for one in series],
            }
            for name, series in table.summaries(found).items()
        ],
    )
    write(path, page)


def _series(
    name: str, one: SeriesSummary, pictures: Sequence[Picture], effort: Effort, seed: int
) -> dict[str, Any]:
    return {
        "summary": one,
        "cells": table.cells(name, one)[1:],
        "definition": one.series,
        "plots": [Markup(svg) for svg in charts.of_series(one)],  # our own, not from outside
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
