"""The suite of derivatives: parameters of scenes, each by several of Mitsuba's integrators."""

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from comparisons.compare.budget import Asked, Budget, PixelSize, Seconds, usual
from comparisons.report.table import Column, Table
from comparisons.results.case import Case
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


def table(cases: Sequence[Case]) -> Table[Case]:
    """A row for each case: the verdict, the bias of the channel that is farthest off, and the
    seconds in which Mitsuba's noise falls to a percent of the derivative's size in the image
    mean."""
    columns: tuple[Column[Case], ...] = (
        Column("parameter and integrator", lambda case: case.scene),
        Column("verdict", lambda case: case.verdict),
        Column("likeliest cause", lambda case: "" if case.cause is None else case.cause.name),
        Column("bias of the image mean", _bias),
        Column("seconds to 1 %", _seconds, lambda x: "" if x is None else f"{x:.2g}", right=True),
    )
    return Table(columns, list(cases))


def _numbers(case: Case) -> dict[str, Any]:
    return next((rung.numbers for rung in case.rungs if rung.name == "derivative"), {})


def _bias(case: Case) -> str:
    """Of the channel farthest from 0, with its interval, or why there is none."""
    numbers = _numbers(case)
    found, width = (numbers.get(key) or {} for key in ("relative_bias", "half_width_of_bias"))
    known = {channel: value for channel, value in found.items() if value is not None}
    if not known:
        return case.rungs[0].reason if case.verdict == "not-comparable" else ""
    channel = max(known, key=lambda c: abs(known[c]))
    half = width.get(channel)
    return f"{channel} {100.0 * known[channel]:+.3g}" + (f" ± {percent(half)}" if half else " %")


def _seconds(case: Case) -> float | None:
    error = _numbers(case).get("candidate_error")
    taken = case.seconds.get("candidate", {}).get("render")
    return None if error is None or taken is None else taken * (error / 0.01) ** 2
