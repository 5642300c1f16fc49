"""One page about the methods: a single file that needs no network."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from comparisons.experiments.methods.charts import of_family, of_series
from comparisons.experiments.methods.costs import stated
from comparisons.experiments.methods.errors import MOVES, NEIGHBOURS, PIXEL
from comparisons.experiments.methods.pictures import failures
from comparisons.experiments.methods.run import FAMILIES, Effort, Row
from comparisons.experiments.methods.summary import (
    families_of,
    methods_of,
    of_method,
    series_of,
    short,
    total,
)
from comparisons.experiments.methods.wording import nanoseconds, percent, sentences, units
from comparisons.report.templates import template, write
from comparisons.report.values import power_of_ten


def write_page(
    path: Path, rows: Sequence[Row], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> None:
    """Write the page about `rows`, at once or not at all."""
    pictures = failures(rows)
    page = template(
        "methods.html.jinja",
        "experiments/methods",
        short=short,
        ns=nanoseconds,
        units=units,
        percent=percent,
        power=power_of_ten,
    ).render(
        provenance=provenance,
        effort=effort,
        seed=seed,
        pixel=PIXEL,
        neighbours=NEIGHBOURS,
        moves=MOVES,
        families=[
            _family(name, some) | {"pictures": pictures.get(name)}
            for name, some in families_of(rows).items()
        ],
    )
    write(path, page)


def _family(name: str, rows: Sequence[Row]) -> dict[str, Any]:
    family = FAMILIES[name]
    about = {series.name: series.about for series in family.series}
    methods = []
    for method in methods_of(rows):
        some = of_method(rows, method)
        registered = family.methods[method]
        methods.append(
            {
                "name": method,
                "summary": registered.summary,
                "source": registered.source,
                "cost": "",
                "fails": "",
                **stated(method),
                "totals": [
                    total(row for row in some if row.extreme == extreme)
                    for extreme in (False, True)
                ],
            }
        )
    return {
        "name": name,
        "methods": methods,
        "sentences": sentences(rows),
        "plots": [Markup(svg) for svg in of_family(rows)],  # our own, not from outside
        "series": [
            {
                "name": series,
                "about": about[series],
                "axis": some[0].axis,
                "rows": some,
                "plots": [Markup(svg) for svg in of_series(some)],
            }
            for series, some in series_of(rows).items()
        ],
    }
