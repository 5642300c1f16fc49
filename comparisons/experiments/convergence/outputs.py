"""`results.json` and `results.csv` of `reference-rt converge`, and its lines on a terminal."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from comparisons.experiments.convergence.estimates import Line
from comparisons.experiments.convergence.findings import Curves, Findings, Ratio, Target
from comparisons.experiments.convergence.store import Settings
from comparisons.report.table import Column, Table
from comparisons.report.values import percent, shown
from comparisons.results.files import plain, write_json

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


class Rung(NamedTuple):
    """A method at a number of samples.  A grid of a deterministic scene is a rung of ours with one
    replicate and neither bands nor variance."""

    scene: str
    size: tuple[int, int]
    name: str
    title: str
    sampler: str
    asked: int
    spp: int
    replicates: int
    seconds: Sequence[float | None]
    mse: Sequence[float | None]
    relmse: Sequence[float | None]
    variance: float | None
    efficiency: float | None


def rungs_of(one: Curves) -> Iterator[Rung]:
    """Of a scene."""
    for name, found in one.findings.items():
        method = one.methods[name]
        for s in found.steps:
            counts = s.asked, s.spp, s.replicates
            who = one.scene, one.size, name, method.title, method.sampler
            yield Rung(*who, *counts, s.seconds, s.mse, s.relmse, s.variance, s.efficiency)
    for g in one.grids.steps if one.grids is not None else ():
        seconds, mse, relmse = ((value, None, None) for value in (g.seconds, g.mse, g.relmse))
        who = one.scene, one.size, "ours", "ours", "grid"
        yield Rung(*who, g.spp, g.spp, 1, seconds, mse, relmse, None, None)


def _timed(seconds: float) -> str:
    return shown(seconds) if seconds > 0.0 else "disturbed"


RUNGS = (
    Column[Rung](None, lambda rung: rung.scene, key="scene"),
    Column[Rung](None, lambda rung: rung.size[0], key="width"),
    Column[Rung](None, lambda rung: rung.size[1], key="height"),
    Column[Rung]("Method", lambda rung: rung.title),
    Column[Rung](None, lambda rung: rung.name, key="contestant"),
    Column[Rung](None, lambda rung: rung.sampler, key="sampler"),
    Column[Rung](None, lambda rung: rung.asked, key="asked_spp"),
    Column[Rung]("samples", lambda rung: rung.spp, shown, key="spp"),
    Column[Rung](None, lambda rung: rung.replicates, key="replicates"),
    Column[Rung]("seconds", lambda rung: rung.seconds[0], _timed, key="seconds"),
    Column[Rung]("least", lambda rung: rung.seconds[1], _timed, key="seconds_min"),
    Column[Rung]("most", lambda rung: rung.seconds[2], _timed, key="seconds_max"),
    Column[Rung]("MSE", lambda rung: rung.mse[0], shown, key="mse"),
    Column[Rung](None, lambda rung: rung.mse[1], key="mse_low"),
    Column[Rung](None, lambda rung: rung.mse[2], key="mse_high"),
    Column[Rung]("relMSE", lambda rung: rung.relmse[0], shown, key="relmse"),
    Column[Rung]("from", lambda rung: rung.relmse[1], shown, key="relmse_low"),
    Column[Rung]("to", lambda rung: rung.relmse[2], shown, key="relmse_high"),
    Column[Rung]("relative variance", lambda rung: rung.variance, shown, key="relative_variance"),
    Column[Rung]("efficiency", lambda rung: rung.efficiency, shown, key="efficiency"),
)
"""Of results.csv, and on the page those of methods with chance."""


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
    """Write `results.csv`, at once or not at all; what is undefined is empty."""
    Table(RUNGS, [rung for one in curves for rung in rungs_of(one)]).write_csv(path)


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
