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

RUNGS = ("film", "geometry", "direct", "whitted", "statistics", "images")
"""The ladder, in order: a failure is reported at the first rung that breaks."""


@dataclass(frozen=True)
class Tier:
    """One rung of the ladder for one scene: its outcome, why, and the numbers behind it."""

    name: str
    status: Status
    reason: str
    numbers: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Metrics:
    """Image metrics of ours against Mitsuba's picture; NaN where undefined (null in JSON)."""

    ssim: float
    psnr: float
    rmse: float
    relmse: float
    mean_bias: tuple[float, float, float]
    """(mean(ours) - mean(mitsuba)) / mean(mitsuba), per channel R, G, B."""
    nonfinite: int
    """Pixels of either picture with a NaN or an infinity in them."""


@dataclass(frozen=True)
class Images:
    """The two pictures, (height, width, 3) linear sRGB radiance, row 0 on top."""

    ours: FloatArray
    mitsuba: FloatArray


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
    """What a reader should know besides: translations that are approximate, what was left out."""
