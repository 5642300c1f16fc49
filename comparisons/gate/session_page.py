"""The page and `results.json` over all uses of gates in a pytest session."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from comparisons.gate.history import Past
from comparisons.gate.uses import Use, key_of
from comparisons.report.page import MOST_BYTES, ORDER, SIGNS
from comparisons.report.templates import encoded, template
from comparisons.report.templates import write as write_page
from comparisons.results.files import write_json
from comparisons.runs.provenance import ours

SCHEMA = 1
"""Of results.json; increased whenever a reader of the former layout would misread the new one."""

VERDICTS = ("error", *ORDER)
"""The order on the page; "error": of a call that could not be judged."""


def counted(uses: Sequence[Use]) -> str:
    """Such as "12 uses of gates: 11 agree, 1 differ"."""
    counts = Counter(use["verdict"] for use in uses)
    told = ", ".join(f"{counts[verdict]} {verdict}" for verdict in sorted(counts, key=_rank))
    s = "" if len(uses) == 1 else "s"
    return f"{len(uses)} use{s} of gates{': ' if told else ''}{told}"


def write(
    folder: Path, uses: Sequence[Use], past: Mapping[str, Past], seconds: float
) -> tuple[Path, Path]:
    """Write `results.json` and `report.html`; their paths.  Raises ImageError.

        {"schema": 1, "provenance": {...}, "seconds": of the session,
         "counts": {verdict: number of uses},
         "uses": [{"test", "fixture", "call", "verdict", "passed", "headline", "reason", "cause",
                   "z", "seconds", "outcome", "folder": of its own outputs, or "",
                   "history": [{"date", "commit", "verdict", "passed", "z"}], the newest last,
                   "changes": of the verdict over these}]}

    past: by `key_of`, empty without a history.
    """
    provenance = ours()
    listed = []
    for use in uses:
        one = past.get(key_of(use), Past(()))
        told = {key: value for key, value in use.items() if key != "pictures"}
        told["folder"] = use["folder"] and _relative(use["folder"], folder)
        listed.append(told | {"history": [vars(o) for o in one.runs], "changes": one.changes})
    counts = Counter(use["verdict"] for use in uses)
    results, page = folder / "results.json", folder / "report.html"
    document = {"schema": SCHEMA, "provenance": provenance, "seconds": seconds, "counts": counts}
    write_json(results, document | {"uses": listed})

    ranked = sorted(uses, key=lambda use: (use["passed"], _rank(use["verdict"])))
    views = [_view(use, past.get(key_of(use), Past(())), folder) for use in ranked]

    def rendered() -> str:
        return template("session.html.jinja").render(
            uses=views,
            changed=[view for view in views if view["past"].changes],
            counts=[(verdict, counts[verdict]) for verdict in sorted(counts, key=_rank)],
            failing=sum(not use["passed"] for use in uses),
            signs={**SIGNS, "error": "!"},
            provenance={**provenance, "seconds": round(seconds, 1)},
            has_history=bool(past),
        )

    text = rendered()
    if len(encoded(text)) > MOST_BYTES:
        for view in views:
            view["pictures"] = [] if view["passed"] else view["pictures"]
        text = rendered()
    write_page(page, text)
    return results, page


def _view(use: Use, past: Past, folder: Path) -> dict[str, Any]:
    """A use as the template takes it."""
    own = Path(use["folder"] or ".", "report.html")
    place = own if own.is_file() else own.parent
    link = quote(_relative(place, folder)) if use["folder"] else ""
    return {**use, "name": key_of(use), "link": link, "past": past}


def _rank(verdict: str) -> int:
    return VERDICTS.index(verdict)


def _relative(path: str | Path, folder: Path) -> str:
    """A path as seen from a folder."""
    return Path(os.path.relpath(path, folder)).as_posix()
