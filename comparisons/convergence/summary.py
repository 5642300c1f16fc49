"""Curves in a few lines for a terminal, and the command that makes them again."""

import shlex
from pathlib import Path

from comparisons.convergence.curves import Curves
from comparisons.convergence.data import Settings
from comparisons.report.values import percent


def lines_of(curves: Curves) -> list[str]:
    """A line for each contestant, or grid of samples, and for what was left out."""
    lines = []
    ratios = curves.ratios()
    for name, found in curves.findings.items():
        times = ", ".join(
            f"{percent(target.error)} in {'about ' * (target.how == 'extrapolated')}"
            f"{target.seconds.value:.3g} s"
            for target in found.targets
        )
        known = [r.value for r in ratios.get(name, []) if r is not None]
        against = f"; ours / this: {', '.join(f'{value:.2f}' for value in known)}" if known else ""
        lines.append(f"{name}: {times}{against}")
    if curves.grids is not None:
        lines += [
            f"ours, {step.spp} samples: {percent(step.relmse**0.5)} in {step.seconds:.3g} s"
            for step in curves.grids.steps
        ]
        lines += [
            f"Mitsuba {point.variant}, {point.spp} samples: {percent(point.relmse**0.5)} from ours "
            f"in {point.seconds:.3g} s"
            for point in curves.grids.points
        ]
    lines += [f"left out: {line}" for line in curves.left_out]
    return [f"{curves.scene}: {line}" for line in lines]


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


__all__ = ["again", "lines_of"]
