"""The result of one comparison as data, from which `results.json` and the report are made."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

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
    witness: FloatArray | None = None
    """A third renderer's, where one was asked."""


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


WARNING = "warning: "
"""Prefix of those notes of a case that are warnings about its scene."""

INTERRUPTED = "the run was interrupted before this case"
"""Why a requested case is missing."""


def how_many(run: int, missing: int) -> str:
    """The number of cases in words: "64 cases", or "17 of 64 cases run" if some are missing."""
    if missing:
        return f"{run} of {run + missing} cases run"
    return f"{run} case{'s' if run != 1 else ''}"
