"""The HTML page about a run: a single offline file; failed cases come first.

The page loads nothing from the network (its content security policy forbids it), so it can be
archived, mailed, or opened from disk. All text is escaped: scene names come from users. Its script
draws the pictures from float data; without JavaScript there are thumbnails.
"""

import base64
import hashlib
import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from comparisons.report.biases import biases_of, is_of_statistics
from comparisons.report.pictures_data import COARSE, EXACT, Bits, as_json, pack
from comparisons.report.plots import histograms
from comparisons.report.table import Table, table_of
from comparisons.report.templates import encoded, template, write
from comparisons.report.values import label, shown
from comparisons.results.case import (
    INTERRUPTED,
    PASSING,
    Case,
    Images,
    Metrics,
    RungResult,
    Status,
    how_many,
)
from comparisons.results.files import plain
from comparisons.results.headline import headline, in_short
from comparisons.results.naming import named
from comparisons.results.rungs import RUNGS
from reference_rt.util.files import replacing

if TYPE_CHECKING:
    from comparisons.report.thumbnails import Thumbnail, Thumbnails

# `thumbnails` is imported where it is needed: with SciPy that takes 0.6 s, in which workers render
# (`comparisons.suites.run`).

# ---- limits the size of the page: reduces or omits the float pictures of some cases --------------


COARSEST = 32
"""The largest block, in pixels of each side, that is averaged into one pixel; float pictures that
are still too large are omitted."""

FEWEST_BYTES = 1.0
"""Bytes per packed pixel that nearly all pictures need at least."""


@dataclass(frozen=True)
class Fitted:
    """The float pictures of a case as JSON ("": omitted); means over factor x factor pixels."""

    data: str
    factor: int
    bits: Bits = COARSE


def fitted(
    pictures: Sequence[Images | None],
    failed: Sequence[bool],
    most_bytes: int,
    bits: Bits = COARSE,
) -> list[Fitted | None]:
    """The pictures of all cases within `most_bytes`; None where a case has none.

    bits: of pictures that are not reduced.  The largest pictures of cases that did not fail are
    reduced first; those of failed cases only when no others are left.
    """
    kept = {i: _packed(p, 1, most_bytes, bits) for i, p in enumerate(pictures) if p is not None}
    while sum(len(one.data) for one in kept.values()) > most_bytes:
        _, _, coarse = max((not failed[i], len(one.data), i) for i, one in kept.items() if one.data)
        images = pictures[coarse]
        assert images is not None
        by = 1 if kept[coarse].bits == EXACT else 2
        kept[coarse] = _packed(images, by * kept[coarse].factor, most_bytes)
    return [kept.get(i) for i in range(len(pictures))]


def _packed(images: Images, factor: int, most_bytes: int, bits: Bits = COARSE) -> Fitted:
    every = (images.candidate, images.reference, *images.others.values())
    pixels = sum(picture[..., 0].size for picture in every)
    # Packing takes seconds for a picture that cannot fit anyway.
    while factor <= COARSEST and FEWEST_BYTES * pixels > most_bytes * factor**2:
        factor *= 2
    if factor > COARSEST:
        return Fitted("", factor)
    bits = bits if factor == 1 else COARSE
    return Fitted(as_json(pack(images, factor, bits)), factor, bits)


MOST_BYTES = 15_000_000
"""Default size limit of a page: it can still be mailed, and opens without a wait."""

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
    "unchanged": "=",
}
"""Shown beside a verdict, so that it is recognised without its colour."""

ORDER = tuple(SIGNS)
"""The order of cases on the page: those that need attention first."""

MOST_OPEN = 4
"""Cases of a page whose passing cases are shown whole, too; of longer pages they are collapsed."""

MOST_MAPPED = 12
"""Cases of a page whose passing cases have maps of FLIP, too, each of which takes 0.1 s."""

MODES = (
    ("side", "side by side"),
    ("flip", "flip"),
    ("blink", "blink"),
    ("slider", "slider"),
    ("single", "single"),
    ("onion", "onion skin"),
)
"""Ways of viewing the pictures, in the order of their keys 1 to 6."""

SCRIPTS = (
    *("unpack.js", "colour.js", "crop.js", "view.js"),
    *("overview.js", "link.js", "viewer.js"),
)
"""Concatenated in this order to one module."""


def write_report(
    path: Path,
    cases: Sequence[Case],
    provenance: Mapping[str, Any],
    *,
    title: str = "",
    walls: Mapping[str, float] | None = None,
    most_bytes: int = MOST_BYTES,
    not_run: Mapping[str, str] | None = None,
    missing: Sequence[str] = (),
) -> None:
    """Write the page about `cases`, whole or not at all.

    title: the suite's name, by default those of the scenes;  walls: seconds of each case in all, by
    name;  not_run: why other cases were not run, by name;  missing: names of requested cases that
    were not run, because the run was interrupted;  provenance: facts by name, shown as they are:
    versions, Mitsuba's variant and why it was chosen, machine and date;  most_bytes: a page that
    would be larger stores its float pictures at lower resolution, those of passing cases first, and
    says so; text and thumbnails are never cut.

    In the numbers of a rung, a name that ends in `_bias` means a fraction and is shown in percent.
    """
    from comparisons.report.thumbnails import thumbnails

    ranked = sorted(cases, key=lambda case: ORDER.index(case.verdict))
    mapped = len(cases) <= MOST_MAPPED
    views = [_view(case, mapped or case.verdict in FAILED, walls or {}) for case in ranked]
    named = title or ", ".join(case.scene for case in cases[:MOST_OPEN])
    failing = sum(case.verdict not in PASSING for case in cases)
    idle = [(name, "missing", INTERRUPTED) for name in missing]
    idle += [(name, "not run", why) for name, why in (not_run or {}).items()]
    verdict = how_many(len(cases), len(missing))
    if cases:
        verdict += f": {f'{failing} fail' if failing else 'all pass'}"
    if not_run:
        verdict += f"; {len(not_run)} not run"
    filled = template("page.html.jinja").render
    script = Markup(_script())  # trusted: part of this package
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    counts = Counter(case.verdict for case in cases)

    few = len(cases) <= MOST_OPEN
    layers = [
        (view, name, Images(*pair))
        for view in views
        if few and view["pictures"]
        for name, pair in view["case"].images.layers.items()
    ]

    def rendered(pictures: Sequence[Fitted | None]) -> str:
        for (view, name, images), data in zip(layers, pictures[len(views) :], strict=False):
            if data and data.data:
                small = thumbnails(images)
                view["layers"].append((name, Markup(data.data), small.white, small.span))
        for view, data in zip(views, pictures[: len(views)], strict=True):
            # Trusted: `as_json` escapes <, > and &.
            view["data"] = Markup(data.data) if data else ""
            view["factor"] = data.factor if data else 1
        return filled(
            counts=[(status, counts[status]) for status in ORDER if counts[status]],
            sides=_common_sides(cases),
            expanded=few,
            signs=SIGNS,
            modes=MODES,
            provenance=provenance,
            cases=views,
            title=named or "no case",
            verdict=verdict,
            missing=missing,
            idle=idle,
            coarser=sum(view["factor"] > 1 for view in views),
            most_megabytes=most_bytes / 1e6,
            script=script,
            script_digest=digest,
        )

    left = most_bytes - len(encoded(rendered([None] * len(views))))
    # Room for the text around float data, or for the note that it is omitted.
    left -= 4000 * len(views)
    failed = [case.verdict in FAILED for case in ranked]
    pictures = [view["case"].images if view["pictures"] else None for view in views]
    pictures += [images for _, _, images in layers]
    failed += [False] * len(layers)
    page = rendered(fitted(pictures, failed, max(left, 0), EXACT if few else COARSE))
    write(path, page)


def _script() -> str:
    folder = files("comparisons.report")
    return "\n" + "\n".join((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)


def _view(case: Case, mapped: bool, walls: Mapping[str, float]) -> dict[str, Any]:
    """A case as the template takes it.  mapped: whether it has a map of FLIP."""
    from comparisons.report.thumbnails import of_others

    short, seen = in_short(case)
    pictures = _thumbnails(case)
    return {
        "case": case,
        "told": lambda text: named(text, case.sides),
        "failed": case.verdict in FAILED,
        "rank": ORDER.index(case.verdict),
        "headline": named(headline(case), case.sides),
        "short": named(short, case.sides),
        "seen": seen,
        "wall": f"{walls[case.scene]:.1f}" if case.scene in walls else "",
        "biases": _biases(case),
        "reason": "" if is_of_statistics(case) else named(case.reason, case.sides),
        "tiers": sorted(case.rungs, key=lambda rung: _rung(rung.name)),
        "pictures": pictures,
        "layers": [],
        "figures": _figures(case, pictures, mapped) if pictures else [],
        "others": of_others(case.images, case.sides) if pictures and case.images else [],
        "whose": [*case.sides, *(case.images.others if case.images else ())],
        "histograms": _histograms(case, pictures) if pictures else [],
        "metrics": _metrics(case.metrics) if case.metrics else None,
        "times": _times(case),
    }


def _biases(case: Case) -> Table[Any] | None:
    """The numbers of the statistics, each with a capital letter; None if there are none."""
    if (table := biases_of(case)) is None:
        return None
    texts: list[list[Any]] = [table.head, *table.cells]
    head, *rows = (
        [f"{cell[:1].upper()}{cell[1:]}".replace(" %", "\N{NO-BREAK SPACE}%") for cell in row]
        for row in texts
    )
    return table_of(head, rows)


def _times(case: Case) -> Table[Any] | None:
    """The seconds of each step, a column for each side; None if there are none."""
    sides = dict(zip(("candidate", "reference"), case.sides, strict=True))
    stages = dict.fromkeys(stage for times in case.seconds.values() for stage in times)
    if not stages:
        return None
    columns = case.seconds.values()
    rows = [[label(stage), *(shown(times.get(stage)) for times in columns)] for stage in stages]
    total = ["total", *(shown(sum(times.values())) for times in columns)]
    return table_of(["Step", *(sides.get(who, who) for who in case.seconds)], [*rows, total])


def _common_sides(cases: Sequence[Case]) -> tuple[str, str]:
    """What the sides are called, if all cases call them the same; else their roles."""
    found = {case.sides for case in cases}
    return found.pop() if len(found) == 1 else ("candidate", "reference")


def _histograms(case: Case, pictures: "Thumbnails") -> list[dict[str, Any]]:
    """Title, drawing and text of each histogram."""
    assert case.images is not None
    # Trusted: `svg` escapes its texts.
    return [
        {"title": one.title, "svg": Markup(one.svg), "text": one.text}
        for one in histograms(case.images, pictures.span)
    ]


def _thumbnails(case: Case) -> "Thumbnails | None":
    """None without pictures, and for pictures without pixels, which a gate may get."""
    from comparisons.report.thumbnails import thumbnails

    images = case.images
    if images is None or not images.candidate.size or not images.reference.size:
        return None
    return thumbnails(images, case.is_signed)


def _figures(
    case: Case, pictures: "Thumbnails", mapped: bool
) -> list[tuple[str, "Thumbnail", str]]:
    """Kind, thumbnail and title of each picture; the z-map, drawn by the script, has none."""
    from comparisons.report.thumbnails import flip_map

    candidate, reference = case.sides
    figures = [
        ("candidate", pictures.candidate, candidate),
        ("reference", pictures.reference, reference),
    ]
    if pictures.difference:
        figures.append(("difference", pictures.difference, f"{candidate} − {reference}"))
        if case.images and case.images.error is not None:
            figures.append(("z", pictures.candidate, "difference / standard error"))
    if (
        mapped
        and case.images
        and not case.is_signed
        and (found := flip_map(case.images)) is not None
    ):
        figures.append(("flip", found[0], f"FLIP, 0 to {shown(found[1])}"))
    return figures


def _rung(name: str) -> int:
    return RUNGS.index(name) if name in RUNGS else len(RUNGS)


def _metrics(metrics: Metrics) -> Table[Any]:
    rows = [
        ("SSIM", shown(metrics.ssim)),
        ("FLIP", shown(metrics.flip)),
        ("PSNR, dB", shown(metrics.psnr)),
        ("RMSE, W·sr⁻¹·m⁻²", shown(metrics.rmse)),
        ("relMSE", shown(metrics.relmse)),
        ("Mean bias", shown(dict(zip("RGB", metrics.mean_bias, strict=True)), "mean_bias")),
        ("Pixels not finite", shown(metrics.nonfinite)),
    ]
    return table_of(("", ""), rows)


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
                    "left_out": [features that were left out, and why],
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
        "cases": [_case_data(case) for case in cases],
    }
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    # Control characters, valid in JSON, would act on a terminal.
    text = re.sub("[\x7f-\x9f]", lambda found: f"\\u{ord(found[0]):04x}", text)
    with replacing(path) as temporary:
        # A lone surrogate, from a file name that is not UTF-8, becomes a JSON escape.
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def _case_data(case: Case) -> dict[str, Any]:
    rungs = {rung.name: _rung_data(rung) for rung in case.rungs}
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


def _rung_data(rung: RungResult) -> dict[str, Any]:
    numbers: dict[str, Any] = plain(rung.numbers)
    if clash := {"status", "reason"} & numbers.keys():
        raise ValueError(f"{rung.name}: a number may not be called {', '.join(sorted(clash))}")
    return {"status": rung.status, "reason": rung.reason, **numbers}
