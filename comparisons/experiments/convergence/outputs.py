"""`results.json` and `results.csv` of `reference-rt converge`, and its lines on a terminal."""

import csv
import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from comparisons.experiments.convergence.estimates import Line
from comparisons.experiments.convergence.findings import Curves, Findings, Ratio, Target
from comparisons.experiments.convergence.store import Settings
from comparisons.report.values import percent
from comparisons.results.files import csv_file, plain, write_json

# ---- for a terminal -----------------------------------------------------------------------------


def lines_of(curves: Curves) -> list[str]:
    """A line for each method, or grid of samples, and for what was not measured."""
    if curves.problem:
        return [f"{curves.scene}: {curves.problem}"]
    lines = []
    ratios = curves.ratios()
    for name, found in curves.findings.items():
        times = ", ".join(f"{percent(target.error)} {_time(target)}" for target in found.targets)
        known = [_against(r) for r in ratios.get(name, []) if r.times is not None]
        against = f"; ours / this: {', '.join(known)}" if known else ""
        lines.append(f"{name}: {times}{against}")
        if wrong := ", ".join(str(step.spp) for step in found.steps if step.disturbed):
            lines.append(
                f"{name}: times with {wrong} samples are disturbed and left out: more samples took "
                "less"
            )
    lines += [f"no data for {line}" for line in curves.missing]
    if curves.grids is not None:
        lines += [
            f"ours, {step.spp} samples: {percent(step.relmse**0.5)} "
            + (f"in {step.seconds:.3g} s" if step.seconds > 0.0 else "(time disturbed)")
            for step in curves.grids.steps
        ]
        lines += [
            f"Mitsuba {point.variant}, {point.spp} samples: {percent(point.relmse**0.5)} against "
            f"ours in {point.seconds:.3g} s"
            for point in curves.grids.points
        ]
    lines += [f"not measured: {line}" for line in curves.left_out]
    return [f"{curves.scene}: {line}" for line in lines]


def _time(target: Target) -> str:
    seconds = f"{target.seconds.value:.3g} s"
    match target.how:
        case "bias":
            return "never (bias)"
        case "unknown":
            return "unknown"
        case "below":
            return f"in at most {seconds}"
        case "extrapolated":
            return f"in about {seconds} (extrapolated)"
    return f"in {seconds}"


def _against(ratio: Ratio) -> str:
    assert ratio.times is not None
    text = f"{ratio.times.value:.2f}"
    match ratio.bound:
        case "at most" | "at least":
            text = f"{ratio.bound} {text}"
        case "neither":
            text += " (first rungs)"
    return f"{text} (extrapolated)" if ratio.extrapolated else text


def again(path: Path, out: Path, settings: Settings) -> str:
    """The command that repeats one scene alone."""
    command = ["reference-rt", "converge", path.as_posix(), "-o", (out / "again").as_posix()]
    command += ["--time-limit", f"{settings.time_limit:g}", "--max-spp", str(settings.max_spp)]
    command += ["--replicates", str(settings.replicates)]
    command += ["--targets", ",".join(f"{target:g}" for target in settings.targets)]
    if settings.size is not None:
        command += ["--size", "x".join(map(str, settings.size))]
    for name in settings.only:
        command += ["--only", name]
    return shlex.join(command)


# ---- results.json and results.csv ---------------------------------------------------------------


SCHEMA = 1
"""Increased whenever a reader of the former layout would misread the new one."""

KIND = "convergence"

COLUMNS = (
    "scene", "width", "height", "contestant", "sampler", "asked_spp", "spp", "replicates",
    "seconds", "seconds_min", "seconds_max", "mse", "mse_low", "mse_high",
    "relmse", "relmse_low", "relmse_high", "relative_variance", "efficiency",
)  # fmt: skip
"""Of results.csv: one row for each method and rung.  A grid of a deterministic scene is a rung
of ours with one replicate and neither bands nor variance."""


def write_results(
    path: Path, curves: Sequence[Curves], settings: Settings, provenance: Mapping[str, Any]
) -> None:
    """Write `results.json`, at once or not at all.

        {"schema": 1, "kind": "convergence", "provenance": {...}, "settings": {...},
         "scenes": [{"scene", "size": [width, height], "again": command,
                     "reference": {"spp", "pictures", "relmse", "seconds"} or null,
                     "contestants": {name: {"title", "sampler", "side",
                         "rungs": [{"asked_spp", "spp", "replicates",
                                    "seconds": {"median", "min", "max"}, "disturbed",
                                    "mse", "relmse": {"value", "low", "high"},
                                    "relative_variance", "efficiency"}],
                         "slopes": {"mse" and "relmse": {"spp" and "seconds":
                                    {"value", "low", "high"} or null}},
                         "bias" and "relative_bias": {"squared", "low", "high", "seen"},
                         "targets": [{"error", "how", "spp",
                                      "seconds": {"value", "low", "high"}}]}},
                     "absent": {name of another method: why it has no findings},
                     "ratios": {name: [{"error", "value", "low", "high", "extrapolated": whether a
                                        time lies beyond the measured rungs, "bound": "at most" or
                                        "at least" or "neither" where times of first rungs are
                                        upper bounds, else ""} or null]},
                     "grids": {"finest_spp", "steps": [...], "mitsuba": [...]} or null,
                     "crops": [{"kind", "level", "corner", "size",
                                "shown": {name: {"spp", "seconds", "error"}}}],
                     "left_out": [...], "notes": [...],
                     "problem": why there is nothing about the scene, "" for most}]}

    Bands hold the value with a confidence of 95 %; a squared bias lies above "low" with 99.99 % and
    below "high" with 99 %.  "ratios" are ours over the method's.  Strict JSON (RFC 8259): NaN
    and the infinities become null, so a null number says "undefined or unbounded".
    """
    document = {
        "schema": SCHEMA,
        "kind": KIND,
        "provenance": dict(provenance),
        "settings": asdict(settings),
        "scenes": [_scene(one) for one in curves],
    }
    write_json(path, plain(document))


def write_table(path: Path, curves: Sequence[Curves]) -> None:
    """Write `results.csv`, of COLUMNS, at once or not at all; what is undefined is empty."""
    with csv_file(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for one in curves:
            writer.writerows([_cell(value) for value in row] for row in _rows(one))


def _scene(one: Curves) -> dict[str, Any]:
    reference = one.reference
    return {
        "scene": one.scene,
        "size": one.size,
        "again": one.again,
        "reference": None
        if reference is None
        else {
            "spp": reference.spp,
            "pictures": reference.count,
            "relmse": reference.relmse,
            "seconds": reference.seconds,
        },
        "contestants": {name: _method(one, name) for name in one.findings},
        "absent": one.absent,
        "ratios": _ratios(one),
        "grids": None
        if one.grids is None
        else {
            "finest_spp": one.grids.finest,
            "steps": [step._asdict() for step in one.grids.steps],
            "mitsuba": [point._asdict() for point in one.grids.points],
        },
        "crops": [
            {
                "kind": crops.kind,
                "level": crops.level,
                "corner": crops.corner,
                "size": crops.size,
                "shown": {
                    name: {"spp": s.spp, "seconds": s.seconds, "error": s.error}
                    for name, s in crops.shown.items()
                },
            }
            for crops in one.crops
        ],
        "left_out": one.left_out,
        "notes": one.notes,
        "problem": one.problem,
    }


def _method(one: Curves, name: str) -> dict[str, Any]:
    method, found = one.methods[name], one.findings[name]
    return {
        "title": method.title,
        "sampler": method.sampler,
        "side": method.side,
        "rungs": [
            {
                "asked_spp": step.asked,
                "spp": step.spp,
                "replicates": step.replicates,
                "seconds": dict(zip(("median", "min", "max"), step.seconds, strict=True)),
                "disturbed": step.disturbed,
                "mse": step.mse._asdict(),
                "relmse": step.relmse._asdict(),
                "relative_variance": step.variance,
                "efficiency": step.efficiency,
            }
            for step in found.steps
        ],
        "slopes": _slopes(found),
        "bias": {**found.bias._asdict(), "seen": found.bias.is_seen},
        "relative_bias": {**found.relative_bias._asdict(), "seen": found.relative_bias.is_seen},
        "targets": [_target(target) for target in found.targets],
    }


def _slopes(found: Findings) -> dict[str, Any]:
    def interval(line: Line | None) -> Any:
        return line and {"value": line.slope, "low": line.low, "high": line.high}

    return {
        error: {over: interval(line) for over, line in lines.items()}
        for error, lines in found.slopes.items()
    }


def _target(target: Target) -> dict[str, Any]:
    return {
        "error": target.error,
        "how": target.how,
        "seconds": target.seconds._asdict(),
        "spp": target.spp,
    }


def _ratios(one: Curves) -> dict[str, Any]:
    if "ours" not in one.findings:
        return {}
    errors = [target.error for target in one.findings["ours"].targets]
    return {
        name: [
            found.times
            and {"error": error, **found.times._asdict()}
            | {"extrapolated": found.extrapolated, "bound": found.bound}
            for error, found in zip(errors, ratios, strict=True)
        ]
        for name, ratios in one.ratios().items()
    }


def _rows(one: Curves) -> Iterator[list[Any]]:
    for name, found in one.findings.items():
        for step in found.steps:
            yield [
                one.scene, *one.size, name, one.methods[name].sampler, step.asked, step.spp,
                step.replicates, *step.seconds, *step.mse, *step.relmse, step.variance,
                step.efficiency,
            ]  # fmt: skip
    if one.grids is not None:
        for grid in one.grids.steps:
            yield [
                one.scene, *one.size, "ours", "grid", grid.spp, grid.spp, 1, grid.seconds, None,
                None, grid.mse, None, None, grid.relmse, None, None, None, None,
            ]  # fmt: skip


def _cell(value: Any) -> Any:
    return "" if isinstance(value, float) and not math.isfinite(value) else plain(value)
