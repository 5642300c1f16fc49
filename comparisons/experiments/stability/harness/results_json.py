"""The results for machines: `results.json` and `results.csv`."""

import csv
import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from comparisons.experiments.stability.harness.core import MITSUBA, OURS, Effort, Found, Outcome
from comparisons.experiments.stability.harness.family import family
from comparisons.experiments.stability.harness.table import (
    SeriesSummary,
    contestants,
    found_of,
    summarise,
    total,
)
from comparisons.results.files import csv_file, write_json

SCHEMA = 1
"""Raised whenever a reader of the former layout would misread the new one."""

COLUMNS = ("family", "series", "x", "contestant", "cases", "failures", "worst", "open")
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


def write(
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
        writer.writerow(COLUMNS)
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
        "series": [_series(one, effort, seed) for one in series],
    }


def _side(found: Sequence[Found], head: SeriesSummary, name: str) -> dict[str, Any] | None:
    everything, first = total(found, name), total(head.found, name)
    if everything is None:
        return None
    worst = None if first is None else first.worst
    return {"cases": everything.cases, "failures": everything.failures, "worst": _finite(worst)}


def _series(one: SeriesSummary, effort: Effort, seed: int) -> dict[str, Any]:
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
                    name: _flat(f.outcomes[name]) | {"examples": _finite(f.outcomes[name].examples)}
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
        "worst": _finite(some.worst),
        "open": some.open,
    }


def _finite(value: Any) -> Any:
    """Numbers that JSON does not have as text, however deep: "inf", "-inf", "nan"."""
    match value:
        case float() if not math.isfinite(value):
            return str(value)
        case Mapping():
            return {key: _finite(item) for key, item in value.items()}
        case list() | tuple():
            return [_finite(item) for item in value]
        case _:
            return value
