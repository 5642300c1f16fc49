"""`results.json`: the results of a run for machines; the page shows the same data."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from comparisons.results.case import Case, RungResult
from comparisons.results.files import plain
from comparisons.results.headline import headline
from reference_rt.util.files import replacing

SCHEMA = 2
"""Increased whenever a reader of the former layout would misread the new one."""


def write_results(
    path: Path,
    cases: Sequence[Case],
    provenance: Mapping[str, Any],
    suite: str | None = None,
    not_run: Mapping[str, str] | None = None,
    missing: Sequence[str] = (),
) -> None:
    """Write `results.json`, whole or not at all.

        {"schema": 2, "suite": name or null, "provenance": {...},
         "asked": number of requested cases, without those of "not_run",
         "missing": [names of requested cases that were not run: the run was interrupted],
         "not_run": {name of a case: why it was not run},
         "cases": [{"scene", "verdict", "headline": one plain sentence, "reason",
                    "sides": {"candidate": whose pictures, "reference": whose},
                    "tiers": {name of a rung: {"status", "reason", and the rung's numbers}},
                    "metrics": {"ssim", "flip", "psnr", "rmse", "relmse", "mean_bias",
                                "nonfinite"} or null,
                    "cause": {"name", "evidence", "explained"} or null,
                    "worst": [{"x", "y", "width", "height", "what"}],
                    "seconds": {side: {step: seconds}}, "notes": [...],
                    "left_out": [features that were specialised away, and why],
                    "again": command that runs this case alone}]}

    Strict JSON (RFC 8259): NaN and the infinities become null, so a null number means "undefined or
    unbounded" (such as the PSNR of equal pictures), never zero. Raises ValueError if two rungs of a
    case have the same name or a number of a rung is called status or reason.
    """
    document = {
        "schema": SCHEMA,
        "suite": suite,
        "provenance": plain(provenance),
        "asked": len(cases) + len(missing),
        "missing": list(missing),
        "not_run": dict(not_run or {}),
        "cases": [_case(case) for case in cases],
    }
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    # Control characters, valid in JSON, would act on a terminal.
    text = re.sub("[\x7f-\x9f]", lambda found: f"\\u{ord(found[0]):04x}", text)
    with replacing(path) as temporary:
        # A lone surrogate, from a file name that is not UTF-8, becomes a JSON escape.
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def _case(case: Case) -> dict[str, Any]:
    rungs = {rung.name: _rung(rung) for rung in case.rungs}
    if len(rungs) < len(case.rungs):
        raise ValueError(f"{case.scene}: two rungs have the same name")
    return {
        "scene": case.scene,
        "verdict": case.verdict,
        "headline": headline(case),
        "reason": case.reason,
        "sides": dict(zip(("candidate", "reference"), case.sides, strict=True)),
        "tiers": rungs,
        "metrics": plain(case.metrics),
        "cause": plain(case.cause),
        "worst": plain(case.worst),
        "seconds": plain(case.seconds),
        "notes": list(case.notes),
        "left_out": list(case.left_out),
        "again": case.again,
    }


def _rung(rung: RungResult) -> dict[str, Any]:
    numbers: dict[str, Any] = plain(rung.numbers)
    if clash := {"status", "reason"} & numbers.keys():
        raise ValueError(f"{rung.name}: a number may not be called {', '.join(sorted(clash))}")
    return {"status": rung.status, "reason": rung.reason, **numbers}
