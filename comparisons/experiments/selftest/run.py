"""The whole self-test: sensitivity, power, calibration, specificity, and their tables."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Say
from comparisons.experiments.selftest.calibration import Calibration, calibration
from comparisons.experiments.selftest.fault import Fault, Finding
from comparisons.experiments.selftest.power import Curve, power_curves
from comparisons.experiments.selftest.sensitivity import Budgets, sensitivity
from comparisons.experiments.selftest.specificity import Alarms, specificity
from comparisons.report.table import Column, Table
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


FAULTS = (
    Column[dict[str, Finding]]("fault", lambda of: _any(of).fault),
    Column[dict[str, Finding]]("planted in", lambda of: _any(of).kind),
    Column[dict[str, Finding]]("scene", lambda of: _any(of).scene),
    Column[dict[str, Finding]]("standard: rung, strength", lambda of: _strength(of, "standard")),
    Column[dict[str, Finding]]("smoke: rung, strength", lambda of: _strength(of, "smoke")),
)
"""Of the findings of each suite."""

POWER = (
    Column[Curve]("fault", lambda curve: curve.fault),
    Column[Curve]("caught by a run of `smoke`, by size", lambda curve: curve.by_size),
)

CALIBRATION = (
    Column[Calibration]("scene", lambda one: one.scene),
    Column[Calibration]("stated bias", lambda one: f"{one.stated:.2%}"),
    Column[Calibration]("caught", lambda one: f"{one.caught:.1%}"),
    Column[Calibration]("half of it caught", lambda one: f"{one.half_caught:.1%}"),
)

ALARMS = (
    Column[Alarms]("right renderers", lambda alarms: alarms.kind),
    Column[Alarms]("case", lambda alarms: alarms.name),
    Column[Alarms]("pictures", lambda alarms: "rendered" if alarms.rendered else "drawn"),
    Column[Alarms]("runs", lambda alarms: f"{alarms.runs:,}"),
    Column[Alarms]("false alarms", lambda alarms: alarms.false_alarms),
    Column[Alarms]("at most (95 %)", lambda alarms: f"{alarms.upper:.2%}"),
)


def markdown(outcome: Outcome) -> str:
    """The tables of docs/results/selftest.md."""
    by_name: dict[str, dict[str, Finding]] = {}
    for found in outcome.findings:
        by_name.setdefault(found.fault, {})[found.suite] = found
    others: list[Table[Any]] = [
        Table(POWER, outcome.curves),
        Table(CALIBRATION, outcome.calibrations),
        Table(ALARMS, outcome.alarms),
    ]
    lines = Table(FAULTS, list(by_name.values())).markdown()
    for table in others:
        lines += ["", *table.markdown()] if table.rows else []
    return "\n".join(lines) + "\n"


def _any(of: dict[str, Finding]) -> Finding:
    """What all suites say alike."""
    return next(iter(of.values()))


def _strength(of: dict[str, Finding], suite: str) -> str:
    """What broke, and how clearly; in short where the first suite says the same."""
    words = _words(of.get(suite))
    return "the same" if suite != SUITES[0] and words == _words(of.get(SUITES[0])) else words


def _words(found: Finding | None) -> str:
    if found is None:
        return ""
    return f"{found.rung}: {found.strength}" if found.caught else "**missed**"
