"""A run for people and programs: progress, distinct findings, JSON, JUnit, the page."""

import shlex
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from junitparser import Failure

from comparisons.experiments.fuzz.coverage import TYPES, coverage
from comparisons.experiments.fuzz.data import text_of
from comparisons.experiments.fuzz.finding import Checked, Finding, Reduced
from comparisons.experiments.fuzz.run import Plan, Run
from comparisons.mitsuba.backend import SCALAR
from comparisons.report.ci import Test, write_tests
from comparisons.report.table import Table, table_of
from comparisons.report.templates import template, write
from comparisons.results.files import write_json
from comparisons.runs.engine import Count
from reference_rt.util.errors import printable
from reference_rt.util.files import replacing

# ---- progress -----------------------------------------------------------------------------------


class Display(Count):
    """Counts scenes and findings."""

    _done, _findings = 0, 0

    def done(self, checked: Checked) -> None:
        """A scene has been checked."""
        self._done += 1
        self._findings += len(checked.findings)
        for finding in checked.findings:
            self.line(f"scene {checked.number}: {finding.rung}: {finding.cause}")
        self.count(f"{self._findings} findings")
        if not self.is_terminal and self._done % 100 == 0:
            self.line(f"{self._done} scenes, {self._findings} findings")


# ---- a run --------------------------------------------------------------------------------------


SCHEMA = 1


def distinct(run: Run) -> list[tuple[Reduced, int]]:
    """Findings without repetitions, and how many scenes had each: by rung and cause, and of reduced
    ones by the types that are left.  The most frequent come first."""
    counts = Counter(finding.key for _, finding in run.findings)
    found: dict[tuple[Any, ...], Reduced] = {}
    for one in run.reduced:
        found.setdefault(one.signature, one)
    reduced = {one.number: one for one in run.reduced}
    original = {
        reduced[number].signature: finding.key
        for number, finding in run.findings
        if number in reduced
    }
    shown = [(one, counts[original.get(key, one.finding.key)]) for key, one in found.items()]
    have = {original.get(key, one.finding.key) for key, one in found.items()}
    for number, finding in run.findings:
        if finding.key not in have:
            have.add(finding.key)
            shown.append((Reduced(number=number, finding=finding, scene={}), counts[finding.key]))
    return sorted(shown, key=lambda item: (-item[1], item[0].number))


def again(plan: Plan, one: Reduced) -> str:
    """The command that repeats a finding: with the reduced scene if there is one."""
    words = ["reference-rt", "fuzz"]
    if one.scene:
        words += ["--scene", str(scene_file(plan.out, one))]
        if one.pixels:
            words += ["--rays", str(one.pixels)]
    else:
        words += ["--seed", str(plan.seed), "--first", str(one.number), "--count", "1"]
        words += ["--extreme"] if plan.grammar.extreme else []
        words += ["--features", ",".join(plan.grammar.features)] if plan.grammar.features else []
    words += ["--renderer", plan.command] if plan.command else []
    words += ["--variant", plan.effort.variant] if plan.effort.variant != SCALAR else []
    return shlex.join([*words, "--out", str(plan.out / "again")])


def scene_file(out: Path, one: Reduced) -> Path:
    """The file of a reduced scene: beside the files that it names."""
    return out / "files" / f"finding-{one.number}.yaml"


def write_results(plan: Plan, run: Run, provenance: Mapping[str, Any], junit: Path | None) -> None:
    """Write fuzz.json, the scenes of findings, and JUnit XML if it is asked for."""
    found = distinct(run)
    for one, _ in found:
        if one.scene:
            with replacing(scene_file(plan.out, one)) as temporary:
                temporary.write_text(text_of(one.scene), encoding="utf-8")
    rungs = Counter(f"{n}: {s}" for c in run.scenes.values() for n, s in c.rungs.items())
    covered = coverage(checked.types for checked in run.scenes.values())
    document = {
        "schema": SCHEMA,
        "provenance": dict(provenance),
        "settings": plan.settings,
        "scenes": len(run.scenes),
        "valid": sum(not _is_invalid(f) for f in _first(run)),
        "lit": sum(checked.lit for checked in run.scenes.values()),
        "seconds": run.seconds,
        "fresh": run.fresh,
        "rungs": dict(sorted(rungs.items())),
        "coverage": {
            "types": covered.types,
            "pairs": covered.pairs,
            "possible_pairs": covered.possible,
            "missing_pairs": [list(pair) for pair in covered.missing],
        },
        "findings": [
            {
                "number": one.number,
                "rung": one.finding.rung,
                "cause": one.finding.cause,
                "detail": one.finding.detail,
                "scenes": count,
                "types": one.types,
                "scene": text_of(one.scene) if one.scene else None,
                "again": again(plan, one),
            }
            for one, count in found
        ],
    }
    write_json(plan.out / "fuzz.json", document)
    if junit is not None:
        _write_junit(junit, plan, run)


def _first(run: Run) -> list[Finding | None]:
    return [next(iter(checked.findings), None) for checked in run.scenes.values()]


def _is_invalid(finding: Finding | None) -> bool:
    return finding is not None and finding.rung == "scene"


def _write_junit(path: Path, plan: Plan, run: Run) -> None:
    """A test for each distinct finding, which fails, and one for all scenes without findings."""
    good = sum(f is None for f in _first(run))
    tests = [Test(f"{good} scenes", seconds=run.seconds)]
    for one, count in distinct(run):
        name = f"{one.finding.rung}: {one.finding.cause}"
        failure = Failure(printable(f"{name} ({count} scenes)"), "finding")
        scene = text_of(one.scene) if one.scene else ""
        told = f"{one.finding.detail}\n{scene}\nreproduce: {again(plan, one)}"
        tests.append(Test(name, failure, told))
    write_tests(path, "fuzz", tests)


def words(run: Run) -> list[str]:
    """The run in lines."""
    count = len(run.scenes)
    if not count:
        return ["no scene was checked"]
    valid = sum(not _is_invalid(f) for f in _first(run))
    lit = sum(checked.lit for checked in run.scenes.values())
    lines = [f"{count:,} scenes, {valid / count:.1%} valid, {lit / count:.1%} lit"]
    if run.fresh and run.seconds > 0.0:
        lines[0] += f"; {run.fresh:,} of them now, {60.0 * run.fresh / run.seconds:.0f} a minute"
    covered = coverage(checked.types for checked in run.scenes.values())
    lines.append(
        f"{sum(n > 0 for n in covered.types.values())} of {len(covered.types)} types, "
        f"{covered.share:.1%} of {covered.possible:,} pairs of types"
    )
    found = distinct(run)
    lines.append(f"{len(found)} distinct findings in {len(run.findings)} scenes")
    return lines


# ---- the page -----------------------------------------------------------------------------------


def write_page(path: Path, plan: Plan, run: Run, provenance: Mapping[str, Any]) -> None:
    """Write the page, whole or not at all; all text is escaped."""
    rungs: dict[str, Counter[str]] = {}
    for checked in run.scenes.values():
        for name, status in checked.rungs.items():
            rungs.setdefault(name, Counter())[status] += 1
    findings = [
        {
            "reduced": one,
            "count": count,
            "text": text_of(one.scene) if one.scene else "",
            "again": again(plan, one),
        }
        for one, count in distinct(run)
    ]
    page = template("fuzz.html.jinja", "experiments/fuzz").render(
        lines=words(run),
        findings=findings,
        rungs=table_of(
            ("rung", "scenes by status"),
            [
                (name, ", ".join(f"{count} {status}" for status, count in counts.most_common()))
                for name, counts in rungs.items()
            ],
        ),
        types=Table(TYPES, coverage(c.types for c in run.scenes.values()).rows()),
        provenance={**provenance, "seed": plan.seed},
    )
    write(path, page)
