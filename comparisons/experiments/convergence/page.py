"""One HTML page about error against time: offline, a single file, no script."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from comparisons.experiments.convergence.estimates import Bias, Line
from comparisons.experiments.convergence.findings import Crops, Curves, Ratio, Target
from comparisons.experiments.convergence.outputs import RUNGS, rungs_of
from comparisons.experiments.convergence.store import Settings
from comparisons.report.plots import Curve, log_log, source_of
from comparisons.report.table import Cell, Column, Table, table_of
from comparisons.report.templates import template, write
from comparisons.report.thumbnails import png_url
from comparisons.report.values import percent, shown
from comparisons.statistics.metrics import encode, white_level
from reference_rt.core.arrays import FloatArray

SECONDS = "render time of a picture, s"
SAMPLES = "samples per pixel"

LOWEST = 1e-3
"""Points below this fraction of a curve's lowest point are not drawn, to leave it room."""


def plots_of(curves: Sequence[Curves]) -> dict[str, str]:
    """The plots of relative MSE against time and against samples, by name."""
    found: dict[str, str] = {}
    for one in curves:
        plots = ladder_plots(one) if one.reference is not None else []
        if one.grids is not None:
            plots = grid_plots(one)
        found |= {f"{one.scene}-{k}": p for k, p in zip(("time", "samples"), plots, strict=False)}
    return found


def write_page(
    path: Path, curves: Sequence[Curves], settings: Settings, provenance: Mapping[str, Any]
) -> None:
    """Write the page about `curves`, at once or not at all; all text is escaped."""
    targets = [percent(target) for target in settings.targets]
    page = template("convergence.html.jinja", "experiments/convergence").render(
        provenance=provenance,
        settings=settings,
        summary=_summary(curves, settings),
        scenes=[{**_view(one, targets), "number": k} for k, one in enumerate(curves, 1)],
    )
    write(path, page)


def _summary(curves: Sequence[Curves], settings: Settings) -> dict[str, Any]:
    """Ours against each other method at one target, scene by scene, and the medians."""
    targets = list(settings.targets)
    if not targets:
        none: dict[str, Any] = {key: [] for key in ("columns", "rows", "medians", "absent")}
        return {"target": "", "verdict": "How the error falls with time", **none}
    place = targets.index(0.01) if 0.01 in targets else len(targets) - 1
    titles = {name: c.title for one in curves for name, c in one.methods.items()}
    names = [name for name in titles if name != "ours"]
    rows = []
    known: dict[str, list[Ratio]] = {name: [] for name in names}
    for number, one in enumerate(curves, 1):
        found = {name: ratios[place] for name, ratios in one.ratios().items()}
        cells = [_ratio(found[n]) if n in found else _without_ratio(one, n) for n in names]
        rows.append((number, one.scene, _instead(one), cells))
        for name, ratio in found.items():
            known[name].append(ratio)
    medians = [_median(ratios) for ratios in known.values()]
    each = [
        f"{cell.text} times that of {titles[name]} ({cell.small})"
        for name, cell in zip(names, medians, strict=True)
        if cell.small
    ]
    told = f"is, as a median, {'; '.join(each)}" if each else "cannot be compared"
    return {
        "target": percent(targets[place]),
        "verdict": f"Our time to {percent(targets[place])} relative error {told}",
        "columns": [titles[name] for name in names],
        "rows": rows,
        "medians": medians,
        "absent": [f"{one.scene}: {line}" for one in curves for line in one.missing],
    }


def _instead(one: Curves) -> str:
    """The text in place of the ratios of a scene that has no ladder."""
    if one.problem:
        return one.problem
    if one.grids is None:
        return ""
    return "; ".join(["deterministic: grids of samples instead of rungs", *one.left_out])


def _without_ratio(one: Curves, name: str) -> Cell:
    """The cell of a scene in which the method, or ours, was not requested or has no data."""
    who = next((n for n in ("ours", name) if n in one.absent), None)
    if who is None:
        return Cell("–", "ours not measured" if name in one.findings else "not requested")
    return Cell("no data", "for ours" if who == "ours" else "see below", "bad")


def _median(ratios: Sequence[Ratio]) -> Cell:
    """Over scenes; "never" counts as 0 or as infinity."""
    values = [ratio.times.value for ratio in ratios if ratio.times is not None]
    if not values:
        return Cell("–")
    extrapolated = sum(ratio.extrapolated for ratio in ratios if ratio.times is not None)
    scenes = f"of {len(values)} scene{'s' if len(values) != 1 else ''}"
    parts = [scenes, *([f"{extrapolated} extrapolated"] if extrapolated else [])]
    median = float(np.median(values))
    look = "extrapolated" if extrapolated else ""
    return Cell(f"{median:.2f}" if math.isfinite(median) else "∞", ", ".join(parts), look)


def _view(one: Curves, targets: Sequence[str]) -> dict[str, Any]:
    """What the template shows of a scene."""
    view: dict[str, Any] = {"one": one, "plots": [], "picture": "", "crops": []}
    if one.reference is not None:
        white = white_level(one.reference.mean)
        view["picture"] = _png(one.reference.mean, white)
        view["plots"] = [Markup(svg) for svg in ladder_plots(one)]  # our own
        view["crops"] = [_crops(one, crops, white) for crops in one.crops]
        view["reference"] = (
            f"{one.reference.count} pictures of {one.reference.spp:,} samples per pixel; its own "
            f"noise, relative error {percent(math.sqrt(max(one.reference.relmse, 0.0)))}, "
            "is subtracted"
        )
    if one.grids is not None:
        view["picture"] = _png(one.grids.picture, white_level(one.grids.picture))
        view["plots"] = [Markup(svg) for svg in grid_plots(one)]
    view["tables"] = _tables(one, targets)
    view["rungs"] = Table(RUNGS, [*rungs_of(one)]) if one.findings else None
    return view


_EXTRAPOLATED = (
    "Extrapolated: beyond the last rung, the relMSE is modelled as a / n + c / n^1.5 for n samples "
    "(c = 0 for independent ones), fitted to the last rungs."
)

_SLOPES = (
    "Slopes are of log error over log samples or log time; independent samples have a slope of −1 "
    "over samples. The bias is the error that remains at any number of samples, estimated from "
    "products of different replicates at the last rung, with one-sided bounds (lower: 99.99 %, "
    "upper: 99 %); where no bias is significant, the upper bound is shown. The last column is the "
    "efficiency at the last rung."
)


def _tables(one: Curves, targets: Sequence[str]) -> list[tuple[str, Table[Any], str]]:
    """Titles, tables, and hints below."""
    tables: list[tuple[str, Table[Any], str]] = []
    ratios = one.ratios()
    if one.findings:
        head = ["Method", *targets, *(f"ratio at {target}" for target in targets if ratios)]
        times: list[list[Any]] = []
        laws: list[list[Any]] = []
        for name, found in one.findings.items():
            title = one.methods[name].title
            own = map(_ratio, ratios[name]) if name in ratios else ["1"] * len(targets)
            times.append([title, *map(_reached, found.targets), *(own if ratios else [])])
            slopes = [
                found.slopes[e][over] for e in ("relmse", "mse") for over in ("spp", "seconds")
            ]
            efficiency = shown(found.steps[-1].efficiency)
            laws.append([title, *map(_slope, slopes), _bias(found.relative_bias), efficiency])
        against = ", and the ratio ours / theirs" if ratios else ""
        tables.append((f"Time to a relative error{against}", table_of(head, times), _EXTRAPOLATED))
        of = [f"{of} over {over}" for of in ("relMSE", "MSE") for over in ("samples", "time")]
        columns = [*(f"slope of {what}" for what in of), "bias, relative to ours"]
        head = ["Method", *columns, "1 / (relative variance × s)"]
        tables.append(("Slopes, bias, efficiency", table_of(head, laws), _SLOPES))
    if one.grids is not None:
        finest = f"ours, {one.grids.finest} samples"
        some: list[tuple[str, Any, str]] = [("ours", step, finest) for step in one.grids.steps]
        some += [(f"Mitsuba {p.variant}", p, f"ours, {p.spp} samples") for p in one.grids.points]
        grid: list[Column[tuple[str, Any, str]]] = [
            Column("Renderer", lambda row: row[0]),
            Column("samples per pixel", lambda row: row[1].spp, shown),
            Column("seconds", lambda row: row[1].seconds, _seconds),
            Column("MSE", lambda row: row[1].mse, shown),
            Column("relMSE", lambda row: row[1].relmse, shown),
            Column("against", lambda row: row[2]),
        ]
        tables.append(("Grids", Table(grid, some), ""))
    return tables


# ---- plots --------------------------------------------------------------------------------------


def ladder_plots(one: Curves) -> list[str]:
    """Relative and absolute MSE, each against seconds and samples."""
    levels = {
        percent(t.error): t.error**2 for found in one.findings.values() for t in found.targets
    }
    plots = []
    for name, text, marks in (("relmse", "E[relMSE]", levels), ("mse", "E[MSE]", {})):
        for over, x_label in (("seconds", SECONDS), ("spp", SAMPLES)):
            curves = []
            for number, (method, found) in enumerate(one.findings.items()):
                steps = [s for s in found.steps if over == "spp" or not s.disturbed]
                bands = [getattr(step, name) for step in steps]
                x = [s.seconds.value if over == "seconds" else s.spp for s in steps]
                curves.append(
                    Curve(
                        one.methods[method].title,
                        x,
                        [band.value for band in bands],
                        [band.low for band in bands],
                        [band.high for band in bands],
                        colour=number,
                    )
                )
            plots.append(log_log(curves, x_label, text, levels=marks))
    return plots


def grid_plots(one: Curves) -> list[str]:
    """The same of a deterministic scene."""
    assert one.grids is not None
    steps = one.grids.steps
    plots = []
    steps = tuple(step for step in steps if step.seconds > 0.0)
    for text, values in (("relMSE", [s.relmse for s in steps]), ("MSE", [s.mse for s in steps])):
        for x_label, x in (
            (SECONDS, [s.seconds for s in steps]),
            (SAMPLES, [float(s.spp) for s in steps]),
        ):
            curves = [Curve("ours, against our finest grid", x, values)]
            for number, point in enumerate(one.grids.points, 2):
                at = point.seconds if x_label == SECONDS else float(point.spp)
                error = point.relmse if text == "relMSE" else point.mse
                if error < min(values) * LOWEST:
                    continue  # the table has it
                title = f"Mitsuba {point.variant}, against ours on the same grid"
                curves.append(Curve(title, [at], [error], colour=number))
            plots.append(log_log(curves, x_label, text))
    return plots


# ---- cells --------------------------------------------------------------------------------------


def _reached(target: Target) -> Cell:
    match target.how:
        case "bias":
            return Cell("never", "bias", "never")
        case "unknown":
            return Cell("–", "too few rungs")
        case "below":
            return Cell(f"≤ {_seconds(target.seconds.value)}", "first rung")
    small = f"{_seconds(target.seconds.low)} to {_seconds(target.seconds.high)}"
    if target.how == "extrapolated":
        small = f"extrapolated, {small}"
        return Cell(f"≈ {_seconds(target.seconds.value)}", small, "extrapolated")
    return Cell(_seconds(target.seconds.value), small)


def _seconds(value: float) -> str:
    return f"{shown(float(f'{value:.3g}'))} s" if math.isfinite(value) else "∞"


def _ratio(found: Ratio) -> Cell:
    """A ratio; green or red only if the measured band excludes 1."""
    times = found.times
    if times is None:
        return Cell("–", found.why)
    look = {"less": "good", "more": "bad", "": ""}[found.shown]
    if times.low == times.high:
        return Cell("0" if times.value == 0.0 else "∞", "bias", look)
    sign = {"at most": "≤ ", "at least": "≥ ", "neither": "≈ ", "": ""}[found.bound]
    parts = [f"{times.low:.2f} to {times.high:.2f}"]
    if found.bound:
        parts.insert(0, "first rungs" if found.bound == "neither" else "first rung")
    if found.extrapolated:
        sign, look = sign or "≈ ", "extrapolated"
        parts.insert(0, "extrapolated")
    return Cell(f"{sign}{times.value:.2f}", ", ".join(parts), look)


def _slope(line: Line | None) -> Cell:
    if line is None:
        return Cell("–")
    text, *ends = (f"{value:.2f}".replace("-", "−") for value in line[:3])
    return Cell(text, " to ".join(ends))


def _bias(bias: Bias) -> Cell:
    """Its root: a relative error."""
    most = percent(math.sqrt(max(bias.high, 0.0)))
    if bias.is_seen:
        return Cell(
            percent(math.sqrt(bias.squared)),
            f"significant; {percent(math.sqrt(bias.low))} to {most}",
            "bad",
        )
    return Cell(f"< {most}", "not significant")


# ---- pictures -----------------------------------------------------------------------------------


def _crops(one: Curves, crops: Crops, white: float) -> dict[str, Any]:
    assert one.reference is not None
    (x, y), (width, height) = crops.corner, crops.size
    area = (slice(y, y + height), slice(x, x + width))
    figures = [("the reference", "", one.reference.mean)]
    for name, found in crops.shown.items():
        caption = f"{found.spp:,} samples, {_seconds(found.seconds)}, {percent(found.error)}"
        figures.append((one.methods[name].title, caption, found.picture))
    return {
        "title": f"About {_seconds(crops.level)} each"
        if crops.kind == "time"
        else f"About {percent(crops.level)} of relative error each",
        "where": f"{width} × {height} pixels at ({x}, {y}), where the noise is largest",
        "figures": [
            (title, caption, _png(picture, white), _png(picture[area], white))
            for title, caption, picture in figures
        ],
    }


def _png(picture: FloatArray, white: float) -> str:
    """The data: URL of a picture, exposed for `white`."""
    return png_url(255.0 * encode(np.nan_to_num(picture), white))


# ---- Markdown: times to each error, for docs/results/convergence.md ------------------------------


def markdown(curves: Sequence[Curves], provenance: Mapping[str, Any]) -> str:
    """A table for each scene, with the command, the machine and the date."""
    mitsuba = str(provenance["mitsuba"]).partition(":")[0]
    lines = [f"Measured: {source_of(provenance)}, Mitsuba {mitsuba}."]
    for one in curves:
        width, height = one.size
        lines += ["", f"{one.scene}, {width} × {height} pixels:", ""]
        if not one.findings:
            lines.append(one.problem or "no method has two rungs of samples")
            continue
        errors = [percent(target.error) for target in next(iter(one.findings.values())).targets]
        rows: list[list[Any]] = [
            [one.methods[name].title, *map(_reached, found.targets)]
            for name, found in one.findings.items()
        ]
        lines += table_of(["renderer, sampler", *errors], rows).markdown()
    return "\n".join(lines) + "\n"
