"""The result of one comparison as data, from which `results.json` and the report are made: a case,
the verdict from its rungs, and the exit code of a run from its verdicts.
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from comparisons.results.rungs import RUNGS

FloatArray = npt.NDArray[np.float64]

Status = Literal[
    "agree",  # the same within the stated bound
    "unchanged",  # each picture is bit for bit one of the baseline's
    "differ",  # different beyond the stated bound
    "reference-limited",  # different because of Mitsuba's float32 precision, as the arbiter shows
    "inconclusive",  # too noisy: no bias is proven, but one that matters could be hidden
    "not-comparable",  # Mitsuba has no counterpart of the scene
    "not-applicable",  # the rung does not apply to this scene
    "invalid",  # non-finite pixels, wrong size: the pictures cannot be compared
]


@dataclass(frozen=True)
class RungResult:
    """The result of one rung for one scene: a name of RUNGS, the status, the reason in one
    sentence, and the numbers behind it."""

    name: str
    status: Status
    reason: str
    numbers: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Metrics:
    """Image metrics of the candidate against the reference; NaN where undefined (null in JSON)."""

    ssim: float
    flip: float
    """Mean HDR-FLIP error, 0 to 1, with fixed exposures."""
    psnr: float
    rmse: float
    relmse: float
    mean_bias: tuple[float, float, float]
    """(mean(candidate) - mean(reference)) / mean(reference), per channel R, G, B."""
    nonfinite: int
    """Pixels of either picture with a NaN or an infinity in them."""


@dataclass(frozen=True)
class Images:
    """The two pictures, (height, width, 3) linear sRGB radiance, row 0 on top; where they are means
    of noisy replicates also the standard error of their difference, of the same shape."""

    candidate: FloatArray
    reference: FloatArray
    error: FloatArray | None = None
    others: Mapping[str, FloatArray] = field(default_factory=dict)
    """Of the same scene by other renderers, by whose they are: a witness's; shown, not judged."""
    layers: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    """Other pictures of both sides by name: of hits of the rays through the pixels' centres."""
    reference_error: FloatArray | None = None
    """The reference's part of `error`: its own standard error."""


@dataclass(frozen=True)
class ImageRegion:
    """A region of the pictures that differs: its left and upper edge and its size in pixels, and
    how it differs."""

    x: int
    y: int
    width: int
    height: int
    what: str


@dataclass(frozen=True)
class Cause:
    """The likeliest cause of a difference.

    name: in a few words, such as "half-pixel shift";  evidence: one sentence with the numbers that
    support it;  explained: the fraction of the squared difference beyond noise that it accounts
    for.
    """

    name: str
    evidence: str
    explained: float


@dataclass(frozen=True)
class Case:
    """The complete result for one scene."""

    scene: str
    verdict: Status
    reason: str
    rungs: tuple[RungResult, ...]
    metrics: Metrics | None
    seconds: dict[str, dict[str, float]]
    """Wall clock by side and step: "load" (files, arrays, hierarchy), "compile", "render"."""
    images: Images | None = None
    notes: tuple[str, ...] = ()
    """Further remarks for the reader, such as approximate translations."""
    sides: tuple[str, str] = ("ours", "Mitsuba's")
    """Whose pictures the candidate and the reference are."""
    cause: Cause | None = None
    worst: tuple[ImageRegion, ...] = ()
    """The regions where the pictures differ most, the worst first."""
    left_out: tuple[str, ...] = ()
    """Features that the scene does not use, which were compiled out."""
    again: str = ""
    """The command that repeats this case alone."""
    trace: str = ""
    """The command that shows the rays of a pixel, without the pixel."""

    @property
    def is_signed(self) -> bool:
        """Whether its pictures are derivatives, of values of both signs."""
        return any(rung.name == "derivative" for rung in self.rungs)


def trace_command(scene: Path, size: str | None, defaults: Mapping[str, str]) -> str:
    """`Case.trace` of a scene's file, at a size and with the defaults of Mitsuba's files."""
    words = ["reference-rt", "trace", str(scene), *(["--size", size] if size else [])]
    return shlex.join([*words, *(f"-D{name}={value}" for name, value in defaults.items())])


WARNING = "warning: "
"""Prefix of those notes of a case that are warnings about its scene."""

INTERRUPTED = "the run was interrupted before this case"
"""Why a requested case is missing."""


def how_many(run: int, missing: int) -> str:
    """The number of cases in words: "64 cases", or "17 of 64 cases run" if some are missing."""
    if missing:
        return f"{run} of {run + missing} cases run"
    return f"{run} case{'s' if run != 1 else ''}"


_FAILURES: tuple[Status, ...] = (
    "invalid",  # makes every other result meaningless
    "differ",
    "inconclusive",
    "not-comparable",  # a rung that applies but could not be run: agreement is not shown
    "reference-limited",
)
"""The statuses that keep a scene from agreeing, gravest first."""

PASSING: tuple[Status, ...] = ("agree", "unchanged", "reference-limited")


def decide(results: Sequence[RungResult], metrics: Metrics | None) -> tuple[Status, str]:
    """The verdict on one scene and the reason, which names the first rung that gives it.

    The gravest status of any rung decides: `invalid` (also by pixels not finite in the pictures),
    `differ`, `inconclusive`, `not-comparable`, `reference-limited`; among rungs of that status the
    first one of RUNGS gives the reason. Otherwise the scene is `unchanged` if a rung is, and agrees
    if at least one rung other than `input` agrees; if none does it is `not-comparable`. Raises
    ValueError for a name not in RUNGS.
    """
    if unknown := {result.name for result in results} - set(RUNGS):
        raise ValueError(f"not a rung: {', '.join(sorted(unknown))}; the rungs are {RUNGS}")
    ladder = sorted(results, key=lambda result: RUNGS.index(result.name))
    pixels = metrics.nonfinite if metrics else 0
    if pixels and not any(result.status == "invalid" for result in ladder):
        return "invalid", f"images: {pixels} pixel{'s' if pixels > 1 else ''} not finite"
    for status in _FAILURES:
        for result in ladder:
            if result.status == status:
                return status, f"{result.name}: {result.reason}{_besides(ladder, status)}"
    for result in ladder:
        if result.status == "unchanged":
            return "unchanged", f"{result.name}: {result.reason}"
    agreed = [result for result in ladder if result.status == "agree"]
    if not any(result.name != "input" for result in agreed):
        return "not-comparable", "no rung applies to this scene"
    rungs = ", ".join(result.name for result in agreed)
    # The statistics' reason states the smallest detectable bias: how much the agreement is worth.
    summary = next((result for result in agreed if result.name == "statistics"), agreed[-1])
    return "agree", f"{rungs}: {summary.reason}"


def _besides(ladder: Sequence[RungResult], verdict: Status) -> str:
    """What else was found in pictures that are invalid: a difference that is certain even so."""
    differences = [f"{r.name}: {r.reason}" for r in ladder if r.status == "differ"]
    return f"; besides, {differences[0]}" if verdict == "invalid" and differences else ""


def exit_code(cases: Sequence[Case], missing: Sequence[str] = ()) -> int:
    """0 if every case passes (with a verdict of PASSING), otherwise the highest of these:

    - 4: a case could not be completed (its process died or hung), or there is no case at all;
    - 3: a scene, or one of its files, is invalid;
    - 1: any other case does not pass, or cases are `missing` because the run was interrupted.
    """
    failed = {result.name for case in cases for result in case.rungs} & {"scene", "run"}
    if not cases or "run" in failed:
        return 4
    if failed:
        return 3
    return 0 if not missing and all(case.verdict in PASSING for case in cases) else 1
