"""The rate of false alarms: verdicts about right renderers, over many seeds."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from comparisons.compare.compare import Say
from comparisons.compare.looks import level_of
from comparisons.experiments.selftest.fault import CAUGHT
from comparisons.experiments.selftest.right import CASES, RightCase
from comparisons.gate.copies import fingerprint
from comparisons.gate.gate import gate_pictures, look
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import Reference
from comparisons.results import LIMIT
from comparisons.runs.elsewhere import run_elsewhere
from reference_rt.core.arrays import FloatArray
from reference_rt.util.workers import Workers

ALLOWED = 1e-3
"""Allowed false alarms per case."""

LEVEL = 0.01
"""Of the test whether more false alarms were counted than ALLOWED explains: in a thousand runs one
is expected, and four or fewer are no evidence of more."""


@dataclass(frozen=True)
class Alarms:
    """kind, name, rendered: of the `RightCase`;  runs: verdicts about new pictures;  false_alarms:
    those that are `differ` or `invalid`;  reasons: their numbers by the first words;  verdicts: all
    by status;  upper: the upper 95 % confidence bound of the rate of false alarms (Clopper and
    Pearson 1934)."""

    kind: str
    name: str
    rendered: bool
    runs: int
    false_alarms: int
    reasons: dict[str, int]
    verdicts: dict[str, int]
    upper: float

    @property
    def holds(self) -> bool:
        """Whether the runs do not show a rate above ALLOWED."""
        return self.false_alarms <= float(stats.binom.isf(LEVEL, self.runs, ALLOWED))

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def specificity(runs: int, scenes: Path, say: Say, workers: Workers) -> list[Alarms]:
    """`runs` verdicts about each of CASES: most of the time is NumPy's, which uses one core."""
    tasks = ((number, runs, scenes.resolve()) for number in range(len(CASES)))
    found = []
    for one in run_elsewhere(workers, _of_case, tasks):
        found.append(one)
        say(f"{one.kind}, {one.name}: {one.false_alarms} false alarms in {runs} runs")
    return found


def _of_case(number: int, runs: int, scenes: Path) -> Alarms:
    """Of the case with this number: cases hold functions, which cannot be sent to a process."""
    return alarms_of(CASES[number], runs, scenes)


def alarms_of(case: RightCase, runs: int, scenes: Path) -> Alarms:
    """`runs` verdicts about the case, each with random numbers of its own."""
    draw = case.prepare(scenes)
    verdicts: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    for run in range(runs):
        status, reason = verdict(*draw(np.random.default_rng(run)), case.looks)
        verdicts[status] += 1
        if status in CAUGHT:
            reasons[": ".join(part.strip() for part in reason.split(":")[:2])] += 1
    alarms = sum(reasons.values())
    upper = float(stats.beta.ppf(0.95, alarms + 1, runs - alarms)) if alarms < runs else 1.0
    return Alarms(
        case.kind, case.name, case.rendered, runs, alarms, dict(reasons), dict(verdicts), upper
    )


def verdict(
    candidate: FloatArray, reference: FloatArray, looks: Sequence[int] = ()
) -> tuple[str, str]:
    """The gate's verdict on replicates (R, height, width, 3), and the reason; with looks that of
    the statistics, at the first that decides."""
    pictures = [Picture(picture) for picture in candidate]
    for number, count in enumerate(looks, start=1):
        rung = look(pictures[:count], Reference(reference[:count]), LIMIT, level_of(number))
        if rung.status != "inconclusive" or count == looks[-1]:
            return rung.status, f"{rung.name}: {rung.reason}"
    prints = tuple(fingerprint(picture) for picture in reference)
    case = gate_pictures(pictures, Reference(reference, fingerprints=prints))
    return case.verdict, case.reason
