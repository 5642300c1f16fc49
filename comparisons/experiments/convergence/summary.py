"""Curves in a few lines for a terminal, and the command that repeats them."""

import shlex
from pathlib import Path

from comparisons.experiments.convergence.curves import Curves
from comparisons.experiments.convergence.data import Settings
from comparisons.experiments.convergence.findings import Ratio, Target
from comparisons.report.values import percent


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
    lines += [f"no data for {line}" for line in curves.missing]
    if curves.grids is not None:
        lines += [
            f"ours, {step.spp} samples: {percent(step.relmse**0.5)} in {step.seconds:.3g} s"
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
    return shlex.join(command if settings.starts else [*command, "--no-starts"])
