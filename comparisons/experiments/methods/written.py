"""What was measured, for machines: `results.json` and `results.csv`, which hold the same rows."""

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from comparisons.experiments.methods.errors import CONFIDENCE, MOVES, NEIGHBOURS, PIXEL
from comparisons.experiments.methods.run import Effort, Row
from reference_rt.util.files import replacing

SCHEMA = 1
"""Raised whenever a reader of the former layout would misread the new one."""

MEANING = {
    "x": "how extreme the setting is; null in a series of one setting",
    "extreme": "whether it counts as extreme",
    "parts": "shapes that each ray is asked about; the answer is the nearest hit",
    "checked": "rays that exact arithmetic was asked about",
    "touching": "of these, rays exactly through an edge or tangent: either answer is right",
    "hits": "exact hits",
    "lost": "hits reported as misses",
    "false": "misses reported as hits",
    "misplaced": f"hits off by more than {PIXEL:g} of the shape's size",
    "ties": "of these three, rays whose exact answer is another for one of "
    f"{MOVES} rays moved by up to {NEIGHBOURS} units in the last place",
    "wrong_share": "(lost + false + misplaced) / (checked - touching)",
    "wrong_low": f"Clopper and Pearson's interval of {CONFIDENCE:.0%}",
    "wrong_high": "its other end",
    "error_median": "|t - exact| of rays that both hit, in units of 2^-53 (|t| + size / |d|), or"
    " of 2^-53 |t| in a series that is relative",
    "ns": "nanoseconds per ray and part, one thread, warm: the median of `runs` runs",
    "ns_low": "lower quartile of the runs",
    "ns_high": "upper quartile",
    "timed": "rays of a run",
    "differs": "of `compared` rays, those whose t is not bit for bit that of the first method",
    "build_seconds": "to build the hierarchy, the best of three",
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
    with replacing(folder / "results.json") as temporary:
        text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with (
        replacing(folder / "results.csv") as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.DictWriter(file, list(flat[0]) if flat else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)
