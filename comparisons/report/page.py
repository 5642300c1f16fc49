"""One HTML page about a run: offline, a single file, what failed comes first.

The page asks for nothing beyond itself (its content security policy forbids it), so it can be
kept, mailed, or opened from disk. All text is escaped: names of scenes come from outside. The
pictures are drawn from float data by the page's own script; without it there are thumbnails.
"""

import base64
import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from markupsafe import Markup

from comparisons.report.fitting import Fitted, fitted
from comparisons.report.templates import encoded, template, write
from comparisons.report.thumbnails import Thumbnail, Thumbnails, thumbnails
from comparisons.report.values import shown
from comparisons.results.case import RUNGS, Case, Metrics, Status, how_many

MOST_BYTES = 15_000_000
"""Of a page, unless the caller says otherwise: what is still mailed and opened without a wait."""

ORDER: tuple[Status, ...] = (
    "invalid",
    "differ",
    "inconclusive",
    "not-comparable",
    "not-applicable",
    "reference-limited",
    "agree",
)
"""What needs attention comes first."""

FAILED = frozenset({"invalid", "differ", "inconclusive"})
"""Verdicts whose pictures are the last to lose detail."""

SIGNS: dict[Status, str] = {
    "invalid": "!",
    "differ": "✗",
    "inconclusive": "?",
    "not-comparable": "–",
    "not-applicable": "–",
    "reference-limited": "≈",
    "agree": "✓",
}
"""Beside the word of a verdict, which a reader need then not tell by its colour."""

MODES = (
    ("side", "side by side"),
    ("flip", "flip"),
    ("blink", "blink"),
    ("slider", "slider"),
    ("single", "single"),
)
"""Views of the pictures, in the order of their keys 1 to 5."""

SCRIPTS = ("unpack.js", "colour.js", "crop.js", "view.js", "viewer.js")
"""In this order one module."""


def write_report(
    path: Path,
    cases: Sequence[Case],
    provenance: Mapping[str, Any],
    *,
    most_bytes: int = MOST_BYTES,
    missing: Sequence[str] = (),
) -> None:
    """Write the page about `cases`, at once or not at all.

    missing: names of cases that were asked for and not run, because the run was interrupted.
    `provenance` is shown as it comes: the caller names versions, Mitsuba's variant and why it was
    chosen, the machine and the date. In the numbers of a tier, a name that ends in `_bias` means
    a fraction and is shown in percent; nested mappings and lists are shown in line. A page that
    would be larger than `most_bytes` loses detail in its float pictures, those of passing cases
    first, and says so; its text and thumbnails are never cut.
    """
    ranked = sorted(cases, key=lambda case: ORDER.index(case.verdict))
    views = [_view(case) for case in ranked]
    filled = template("page.html.jinja").render
    script = Markup(_script())  # our own, not from outside
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    counts = Counter(case.verdict for case in cases)

    def rendered(pictures: Sequence[Fitted | None]) -> str:
        for view, data in zip(views, pictures, strict=True):
            # JSON without <, > and & by its maker.
            view["data"] = Markup(data.data) if data else ""
            view["factor"] = data.factor if data else 1
        return filled(
            counts=[(status, counts[status]) for status in ORDER if counts[status]],
            signs=SIGNS,
            modes=MODES,
            provenance=provenance,
            cases=views,
            how_many=how_many(len(cases), len(missing)),
            missing=missing,
            coarser=sum(view["factor"] > 1 for view in views),
            most_megabytes=most_bytes / 1e6,
            script=script,
            script_digest=digest,
        )

    left = most_bytes - len(encoded(rendered([None] * len(views))))
    # What stands around float data, or tells that it was left out, takes room, too.
    left -= 4000 * len(views)
    failed = [case.verdict in FAILED for case in ranked]
    pictures = [view["case"].images if view["pictures"] else None for view in views]
    page = rendered(fitted(pictures, failed, max(left, 0)))
    write(path, page)


def _script() -> str:
    folder = files("comparisons.report")
    return "\n" + "\n".join((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)


def _view(case: Case) -> dict[str, Any]:
    """What the template shows of a case."""
    stages = dict.fromkeys(stage for times in case.seconds.values() for stage in times)
    pictures = _thumbnails(case)
    return {
        "case": case,
        "tiers": sorted(case.tiers, key=lambda tier: _rung(tier.name)),
        "pictures": pictures,
        "figures": _figures(case, pictures) if pictures else [],
        "metrics": _metric_rows(case.metrics) if case.metrics else [],
        "stages": list(stages),
        "totals": {who: sum(times.values()) for who, times in case.seconds.items()},
    }


def _thumbnails(case: Case) -> Thumbnails | None:
    """None also for pictures without a pixel, which a gate may have been given."""
    images = case.images
    if images is None or not images.candidate.size or not images.reference.size:
        return None
    return thumbnails(images)


def _figures(case: Case, pictures: Thumbnails) -> list[tuple[str, Thumbnail, str]]:
    """Kind, thumbnail and title of each picture; the z-map is drawn by the script alone."""
    candidate, reference = case.sides
    figures = [
        ("candidate", pictures.candidate, candidate),
        ("reference", pictures.reference, reference),
    ]
    if pictures.difference:
        figures.append(("difference", pictures.difference, f"{candidate} − {reference}"))
        if case.images and case.images.error is not None:
            figures.append(("z", pictures.candidate, "difference / standard error"))
    return figures


def _rung(name: str) -> int:
    return RUNGS.index(name) if name in RUNGS else len(RUNGS)


def _metric_rows(metrics: Metrics) -> list[tuple[str, str]]:
    return [
        ("SSIM", shown(metrics.ssim)),
        ("FLIP", shown(metrics.flip)),
        ("PSNR, dB", shown(metrics.psnr)),
        ("RMSE, W·sr⁻¹·m⁻²", shown(metrics.rmse)),
        ("relMSE", shown(metrics.relmse)),
        ("Mean bias", shown(dict(zip("RGB", metrics.mean_bias, strict=True)), "mean_bias")),
        ("Pixels not finite", shown(metrics.nonfinite)),
    ]
