"""The rows for machines: `results.json` and `results.csv`, which hold the same columns."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from comparisons.experiments.methods.errors import CONFIDENCE, MOVES, NEIGHBOURS, PIXEL
from comparisons.experiments.methods.run import Effort, Row
from comparisons.results.files import csv_file, write_json

SCHEMA = 1
"""Increased whenever a reader of the former layout would misread the new one."""

MEANING = {
    "x": "how extreme the setting is; null in a series of one setting",
    "extreme": "whether it counts as extreme",
    "parts": "shapes that each ray is traced against; the answer is the nearest hit",
    "checked": "rays that were checked by exact arithmetic",
    "touching": "of these, rays exactly through an edge or tangent: hit and miss are both right",
    "hits": "exact hits",
    "lost": "hits reported as misses",
    "false": "misses reported as hits",
    "misplaced": f"hits off by more than {PIXEL:g} of the shape's size",
    "ties": "of these three, rays whose exact answer changes for at least one of "
    f"{MOVES} copies perturbed by up to {NEIGHBOURS} units in the last place",
    "wrong_share": "(lost + false + misplaced) / (checked - touching)",
    "wrong_low": f"lower end of its {CONFIDENCE:.0%} confidence interval (Clopper and Pearson)",
    "wrong_high": "upper end of that interval",
    "error_median": "|t - exact| where both are hits, in units of 2^-53 (|t| + size / |d|), or"
    " of 2^-53 |t| in a relative series",
    "ns": "nanoseconds per ray and part, one thread, warm: the median of `runs` runs",
    "ns_low": "lower quartile of the runs",
    "ns_high": "upper quartile",
    "timed": "rays of a run",
    "differs": "of `compared` rays, those whose t differs in any bit from the first method's",
    "build_seconds": "to build the acceleration structure, the best of three",
}


def columns(row: Row) -> dict[str, Any]:
    """One row, flat: what both files hold."""
    e, time = row.errors, row.time
    low, high = e.share_interval
    return {
        "family": row.family,
        "series": row.series,
        "x": row.x if row.axis else None,
        "axis": row.axis,
        "extreme": row.extreme,
        "method": row.method,
        "rays": row.rays,
        "parts": row.parts,
        "checked": e.checked,
        "touching": e.touching,
        "hits": e.hits,
        "lost": e.lost,
        "false": e.false,
        "misplaced": e.misplaced,
        "ties": e.ties,
        "wrong_share": e.share,
        "wrong_low": low,
        "wrong_high": high,
        "error_median": e.median,
        "error_p99": e.p99,
        "error_worst": e.worst,
        "relative": row.relative,
        "ns": time.median,
        "ns_low": time.low,
        "ns_high": time.high,
        "runs": time.runs,
        "timed": time.rays,
        "compared": row.compared,
        "differs": row.differs,
        "build_seconds": row.build,
    }


def write(
    folder: Path, rows: Sequence[Row], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> None:
    """Both files, each whole or not at all.

    {"schema": 1, "provenance": {...}, "seed", "effort": {"rays", "checked", "runs"},
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
