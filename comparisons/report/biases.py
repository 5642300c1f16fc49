"""The biases that the statistics measured of a case, would have seen, and permit, as a table."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.padding import Padding

from comparisons.report.table import Table, table_of
from comparisons.results.case import Case
from comparisons.results.headline import detectable, percent
from comparisons.results.naming import named
from reference_rt.util.errors import printable


def biases_of(case: Case) -> Table[Any] | None:
    """A column for the image mean, tiles and pixels each, and a row for what was measured, what
    would have been seen, and what is permitted; None for a case without these numbers."""
    # Suites begin before the statistics are imported.
    from comparisons.statistics.scales import IMAGE, PIXELS, SCALES, TILES

    rung = next((r for r in case.rungs if r.name == "statistics"), None)
    if rung is not None and "edge_wrong" in rung.numbers:
        return _of_edges(rung.numbers)
    seen = detectable(rung)
    biases = {} if rung is None else rung.numbers.get("relative_bias")
    if rung is None or seen is None or not isinstance(biases, Mapping):
        return None
    some = [
        f"{name} {percent(bias, sign=True)}" for name, bias in biases.items() if bias is not None
    ]
    found = ", ".join(some).replace(" %,", ",")
    known = rung.numbers.get("noise_known", True)
    would = percent(seen) if known else "unknown"
    columns = [(IMAGE.what, found, would, _within(rung.numbers.get("limit")))]
    for scale in SCALES[1:]:
        cells = rung.numbers.get(scale.name)
        # Tiles and pixels are shown always, the other scales where they differ.
        if isinstance(cells, Mapping) and (scale in (TILES, PIXELS) or cells["differ"]):
            half = cells.get("median_detectable_bias")
            would = f"{percent(half)} in half of them" if known and half is not None else ""
            column = (f"{cells['tested']:,} {scale.what}", _worst(cells), would)
            columns.append((*column, _within(cells.get("worst_margin"))))
    return _transposed(columns)


def _transposed(columns: list[tuple[str, str, str, str]]) -> Table[Any]:
    names = ("bias", "measured", "would have been seen", "limit")
    head, *rows = zip(names, *columns, strict=True)
    return table_of(head, rows)


def _of_edges(numbers: Mapping[str, Any]) -> Table[Any]:
    """The same of a picture without noise, whose edges are judged apart."""
    inside, edge = (
        f"{n:,} differ" if n else "none differs"
        for n in (numbers["inside_wrong"], numbers["edge_wrong"])
    )
    bound = f"±{percent(numbers['tolerance'])}{' and half a code' if numbers['codes'] else ''}"
    columns = [
        (f"{numbers['inside']:,} pixels inside surfaces", inside, "", bound),
        (f"{numbers['edge']:,} pixels on edges", edge, "", "what their footprints see"),
    ]
    for name, mode in numbers["modes"].items():
        found, would, margin = (mode[key] for key in ("bias", "detectable", "margin"))
        columns.append((f"edges: {name}", f"{found:+.2g}", f"{would:.2g}", f"±{margin:g}"))
    return _transposed(columns)


def _worst(cells: Mapping[str, Any]) -> str:
    """Such as "3 differ; worst -12 ± 2.1 %"."""
    bias, half = cells.get("worst_bias"), cells.get("worst_half_width")
    count = f"{cells['differ']:,} differ" if cells["differ"] else "none differs"
    if bias is None:
        return count
    worst = percent(bias, sign=True)
    if half is not None:
        worst = f"{worst.removesuffix(' %')} ± {percent(half)}"
    return f"{count}; worst {worst}"


def _within(margin: float | None) -> str:
    return "" if margin is None else f"±{percent(margin)}"


def is_of_statistics(case: Case) -> bool:
    """Whether the case's reason is that of the statistics, whose numbers `biases_of` has."""
    return "statistics" in case.reason.partition(": ")[0].split(", ")


_INDENT = 2
"""Columns by which it stands to the right of the headline."""


def tell(console: Console, case: Case) -> None:
    """Print what stands below a headline: the numbers of the statistics as a table, or the reason
    where another rung decides."""
    table = biases_of(case) if is_of_statistics(case) else None
    if table is not None:
        console.print(Padding.indent(table.terminal(console.width - _INDENT), _INDENT))
    else:
        reason = printable(named(case.reason, case.sides))
        console.print(f"{' ' * _INDENT}{reason}", markup=False, soft_wrap=True)
