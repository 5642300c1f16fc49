"""The whole self-test: sensitivity, power, calibration, specificity, and their tables."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Say
from comparisons.experiments.selftest.fault import Fault, Finding
from comparisons.experiments.selftest.sensitivity import (
    Budgets,
    Calibration,
    Curve,
    calibration,
    power_curves,
    sensitivity,
)
from comparisons.experiments.selftest.specificity import Alarms, specificity
from comparisons.results.files import write_json
from comparisons.runs.provenance import provenance
from comparisons.suites.suite import load_suite, plan
from reference_rt.util.files import replacing
from reference_rt.util.workers import Workers

SUITES = ("standard", "smoke")

SMOKE_SHARE = 0.95
"""The fraction of faults that the smoke suite must catch; the standard suite must catch all."""


CALIBRATED = 300
"""Runs of each scene whose stated bias is planted."""


@dataclass
class Outcome:
    """The results so far."""

    findings: list[Finding] = field(default_factory=list)
    curves: list[Curve] = field(default_factory=list)
    calibrations: Sequence[Calibration] = ()
    alarms: Sequence[Alarms] = ()

    def share(self, suite: str) -> tuple[int, int]:
        """(caught, all) faults of the suite."""
        of_suite = [f for f in self.findings if f.suite == suite]
        return sum(f.caught for f in of_suite), len(of_suite)

    @property
    def holds(self) -> bool:
        """Whether `standard` catches all faults, `smoke` SMOKE_SHARE of them, false alarms are as
        rare as promised, and the stated biases are detected as often as promised."""
        standard, smoke = (self.share(suite) for suite in SUITES)
        return (
            standard[0] == standard[1]
            and smoke[0] >= SMOKE_SHARE * smoke[1]
            and all(alarms.holds for alarms in self.alarms)
            and all(one.holds for one in self.calibrations)
        )


def budgets_of(scenes: Path) -> Budgets:
    """The budgets of each suite's scenes."""
    return {
        suite: {w.path.stem: w.budget for w in plan(load_suite(suite), scenes).work
                if not w.budget.control}
        for suite in SUITES
    }  # fmt: skip


def run(
    faults: Sequence[Fault],
    scenes: Path,
    seeds: int,
    out: Path,
    say: Say,
    with_power: bool,
    workers: Workers,
) -> Outcome:
    """Plant `faults`, then count false alarms over `seeds` seeds; writes files after each step."""
    budgets = budgets_of(scenes)
    outcome = Outcome()
    for found in sensitivity(faults, budgets, scenes, workers):
        outcome.findings.append(found)
        said = f"{found.rung}, {found.strength}" if found.caught else f"MISSED: {found.strength}"
        say(f"{found.fault} ({found.suite}): {said}")
        _write(out, outcome)
    if with_power:
        outcome.curves = power_curves(_smoke(budgets), scenes, say)
        _write(out, outcome)
        outcome.calibrations = calibration(CALIBRATED, scenes, say)
        _write(out, outcome)
    if seeds:
        outcome.alarms = specificity(seeds, scenes, say, workers)
        _write(out, outcome)
    return outcome


def _smoke(budgets: Budgets) -> Budget:
    from comparisons.experiments.selftest.of_pictures import SCENE

    return budgets["smoke"][SCENE]


def _write(out: Path, outcome: Outcome) -> None:
    document: dict[str, Any] = {
        "schema": 1,
        "provenance": provenance(),
        "caught": {suite: outcome.share(suite) for suite in SUITES},
        "findings": [found.as_json() for found in outcome.findings],
        "power": [curve.as_json() for curve in outcome.curves],
        "calibration": [one.as_json() for one in outcome.calibrations],
        "specificity": [alarms.as_json() for alarms in outcome.alarms],
    }
    write_json(out / "selftest.json", document)
    with replacing(out / "selftest.md") as temporary:
        temporary.write_text(markdown(outcome), encoding="utf-8")


def markdown(outcome: Outcome) -> str:
    """The tables of docs/results/selftest.md."""
    lines = ["| fault | planted in | scene | standard: rung, strength | smoke: rung, strength |"]
    lines.append("|---|---|---|---|---|")
    by_name: dict[str, dict[str, Finding]] = {}
    for found in outcome.findings:
        by_name.setdefault(found.fault, {})[found.suite] = found
    for name, of in by_name.items():
        one = next(iter(of.values()))
        cells = [_cell(of.get(suite)) for suite in SUITES]
        if cells[1] == cells[0]:
            cells[1] = "the same"
        lines.append(f"| {name} | {one.kind} | {one.scene} | {cells[0]} | {cells[1]} |")
    if outcome.curves:
        lines += ["", "| fault | caught by a run of `smoke`, by size |", "|---|---|"]
        for curve in outcome.curves:
            sizes = ", ".join(
                f"{size:g}: {caught:.0%}"
                for size, caught in zip(curve.sizes, curve.caught, strict=True)
            )
            lines.append(f"| {curve.fault} | {sizes} |")
    if outcome.calibrations:
        lines += ["", "| scene | stated bias | caught | half of it caught |", "|---|---|---|---|"]
        for c in outcome.calibrations:
            lines.append(f"| {c.scene} | {c.stated:.2%} | {c.caught:.1%} | {c.half_caught:.1%} |")
    if outcome.alarms:
        lines += [
            "",
            "| right renderers | case | pictures | runs | false alarms | at most (95 %) |",
        ]
        lines.append("|---|---|---|---|---|---|")
        for a in outcome.alarms:
            how = "rendered" if a.rendered else "drawn"
            counts = f"{a.runs:,} | {a.false_alarms} | {a.upper:.2%}"
            lines.append(f"| {a.kind} | {a.name} | {how} | {counts} |")
    return "\n".join(lines) + "\n"


def _cell(found: Finding | None) -> str:
    if found is None:
        return ""
    strength = found.strength.replace("|", "\\|")
    return f"{found.rung}: {strength}" if found.caught else "**missed**"
