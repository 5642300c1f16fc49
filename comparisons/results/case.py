"""What a comparison found, as data: what `results.json` and the report are made from."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

Status = Literal[
    "agree",  # the same within the stated bound
    "differ",  # different beyond the stated bound
    "reference-limited",  # different, and the cause is Mitsuba's own float32, shown by the arbiter
    "inconclusive",  # too noisy to tell: no bias seen, but one that matters could hide
    "not-comparable",  # nothing to compare with, and why
    "not-applicable",  # a rung that this scene does not have
    "invalid",  # non-finite pixels, wrong size: no statement about agreement is possible
]

RUNGS = ("scene", "run", "input", "film", "geometry", "direct", "whitted", "statistics", "images")
"""The ladder, in order: a failure is reported at the first rung that breaks.  `scene` exists only
where the scene or a file that it names is invalid, `run` only where the case could not be carried
through; `input` says what is wrong with pictures as such."""

COMPARED = RUNGS[3:]
"""The rungs that compare the two renderers: those a suite can be limited to."""


@dataclass(frozen=True)
class Tier:
    """One rung of the ladder for one scene: its outcome, why, and the numbers behind it."""

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


@dataclass(frozen=True)
class Place:
    """A part of the pictures that is worth a look: its left and upper edge and its size in pixels,
    and what is the matter there."""

    x: int
    y: int
    width: int
    height: int
    what: str


@dataclass(frozen=True)
class Cause:
    """The likeliest cause of a difference.

    name: in a few words, such as "half-pixel shift";  evidence: one sentence with the numbers that
    speak for it;  explained: which fraction of the squared difference beyond noise it accounts for.
    """

    name: str
    evidence: str
    explained: float


@dataclass(frozen=True)
class Case:
    """Everything that was found out about one scene."""

    scene: str
    verdict: Status
    reason: str
    tiers: tuple[Tier, ...]
    metrics: Metrics | None
    seconds: dict[str, dict[str, float]]
    """Wall clock by side and step: "load" (files, arrays, hierarchy), "compile", "render"."""
    images: Images | None = None
    notes: tuple[str, ...] = ()
    """What a reader should know besides: translations that are approximate."""
    sides: tuple[str, str] = ("ours", "Mitsuba's")
    """Whose pictures the candidate and the reference are."""
    cause: Cause | None = None
    worst: tuple[Place, ...] = ()
    """Where the pictures differ most, the worst first."""
    left_out: tuple[str, ...] = ()
    """What the scene does not need, and so was not run."""
    again: str = ""
    """The command that repeats this case alone."""


WARNING = "warning: "
"""Begins the notes of a case that are warnings about its scene."""

INTERRUPTED = "the run was interrupted before this case"
"""Why a case that was asked for is missing."""


def how_many(run: int, missing: int) -> str:
    """How many cases were run, of how many that were asked for, in words: "64 cases", or
    "17 of 64 cases run" where the rest is missing."""
    asked = run + missing
    if missing:
        return f"{run} of {asked} cases run"
    return f"{asked} case{'s' if asked != 1 else ''}"
