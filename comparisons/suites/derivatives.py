"""The suite of derivatives: parameters of scenes, each by several of Mitsuba's integrators."""

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path
from typing import Annotated

from pydantic import Field

from comparisons.compare.budget import Asked, Budget, PixelSize, Seconds, usual
from comparisons.report.table import Column, Table
from comparisons.results.case import Case, RungResult
from comparisons.statistics.wording import percent
from comparisons.suites.suite import Changes, Plan, Work, read
from comparisons.translator.derivative import Differentiator
from reference_rt.core.model import Description
from reference_rt.scene.parameters import parameter
from reference_rt.util import yaml_text
from reference_rt.util.errors import SceneError, UsageError

NAME = "derivatives"


class Derivatives(Description):
    """What is asked: small pictures, since the noise of a derivative at a limit of some percent
    asks for few pixels."""

    about: str
    """A one-line description."""
    size: Annotated[PixelSize, Field(strict=False)]
    """Width and height of the pictures, in pixels."""
    spp: Annotated[int, Field(ge=1)]
    """Samples per pixel of each replicate."""
    seconds: Seconds
    """For the replicates of each pair of a parameter and an integrator."""
    case_seconds: Seconds
    """After which a pair is given up: some trees of edges take longer to build than all pictures
    of the others."""
    limit: Annotated[float, Field(gt=0)]
    """The smallest relative bias of the image mean that must be detectable."""
    parameters: dict[str, Annotated[tuple[str, ...], Field(strict=False)]]
    """Paths of parameters, by the name of a scene."""

    def budget(self, asked: Asked) -> Budget:
        """That of one pair."""
        return usual(self.spp, 8, self.seconds, size=self.size, limit=self.limit, derivative=asked)


def load() -> Derivatives:
    """The suite of this package."""
    text = (resources.files("comparisons.suites") / f"{NAME}.yaml").read_text(encoding="utf-8")
    return Derivatives.model_validate(yaml_text.load(text))


def plan(
    suite: Derivatives,
    folder: Path,
    differentiators: Sequence[Differentiator],
    only: Sequence[str] = (),
) -> Plan:
    """The cases, named SCENE.PARAMETER.INTEGRATOR.  only: shell patterns, one of which the name
    must match.  Raises UsageError if there is nothing to run, or for a parameter that is none."""
    work: list[Work] = []
    for name, paths in suite.parameters.items():
        path = folder / f"{name}.yaml"
        scene = read(path)
        for one in paths:
            if not isinstance(scene, SceneError):
                parameter(scene, one)
            for by in differentiators:
                case = f"{name}.{plain(one)}.{plain(by.words)}"
                if only and not any(fnmatchcase(case, pattern) for pattern in only):
                    continue
                asked = Asked(parameter=one, integrator=by.name, guiding=by.guiding)
                work.append(Work(case, path, scene, suite.budget(asked), Changes()))
    if not work:
        raise UsageError("nothing to run: no case matches" + "".join(f" {x}" for x in only))
    return Plan(tuple(work), {})


def plain(text: str) -> str:
    """A part of a case's name, which needs no quoting in a shell."""
    return re.sub(r"[^\w]+", ".", text).strip(".")


def table(planned: Plan, cases: Sequence[Case]) -> Table[tuple[str, str]]:
    """A row for each parameter of a scene, and a column for each integrator."""
    verdicts = {case.scene: verdict_on(case) for case in cases}
    cells: dict[tuple[str, str], dict[str, str]] = {}
    integrators: dict[str, None] = {}
    for work in planned.work:
        asked = work.budget.derivative
        assert asked is not None
        by = Differentiator(asked.integrator, asked.guiding).words
        integrators[by] = None
        row = cells.setdefault((work.path.stem, asked.parameter), {})
        row[by] = verdicts.get(work.name, "not run")

    def column(by: str) -> Column[tuple[str, str]]:
        return Column(by, lambda row: cells[row].get(by, ""))

    scene: Column[tuple[str, str]] = Column("scene", lambda row: row[0])
    moved: Column[tuple[str, str]] = Column("parameter", lambda row: f"`{row[1]}`")
    return Table([scene, moved, *map(column, integrators)], list(cells))


def verdict_on(case: Case) -> str:
    """A cell of the table: the verdict; of a difference the cause, or else what differs; where
    noise hides the answer, the factor of samples that would decide it; of what is right the seconds
    in which Mitsuba's noise falls to a percent of the derivative's size."""
    rungs = {rung.name: rung for rung in case.rungs}
    if (failed := rungs.get("run", rungs.get("scene"))) is not None:
        return failed.reason.partition(";")[0]
    found = rungs["derivative"]
    if case.verdict == "not-comparable":
        return "refused"
    if case.verdict == "inconclusive":
        if (added := found.numbers.get("step_adds")) is not None:
            return f"our step adds up to {percent(added)}"
        factor = found.numbers.get("samples_factor")
        return f"too noisy: x {factor:.2g}" if factor else "too noisy: x ?"
    told = {"agree": "agrees", "differ": "differs"}.get(case.verdict, case.verdict)
    if case.cause is not None:
        told = f"{told}: {case.cause.name}"
    elif "adjoint" in rungs and rungs["adjoint"].status == "differ":
        told = f"{told}: forward and reverse mode"
    elif case.verdict == "differ":
        told = f"{told}: {_difference(found)}"
    error = found.numbers.get("candidate_error")
    taken = case.seconds.get("candidate", {}).get("render")
    if error is None or taken is None or case.verdict != "agree":
        return told
    return f"{told} ({taken * (error / 0.01) ** 2:.2g} s)"


def _difference(found: RungResult) -> str:
    """The bias of the channel that is farthest off, with its interval, where the image mean
    differs; else where it is seen."""
    image = found.numbers.get("image") or {}
    if not image.get("differs"):
        return found.reason.partition(",")[0].partition(";")[0]
    biases, widths = (image.get(key) or {} for key in ("relative_bias", "half_width_of_bias"))
    known = {channel: value for channel, value in biases.items() if value is not None}
    channel = max(known, key=lambda c: abs(known[c]))
    half = widths.get(channel)
    return f"{channel} {100.0 * known[channel]:+.3g}" + (f" ± {percent(half)}" if half else " %")
