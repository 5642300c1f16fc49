"""Advice for a run that was too noisy: how many more samples are needed, and on which side.

The samples of both sides can be raised in a comparison of two renderers. At a gate only the
candidate's can: the reference may be a baseline of few replicates. If these alone are too noisy, no
candidate could show agreement, and the advice is about the reference.
"""

import math

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import image_test
from comparisons.statistics.metrics import ratio
from comparisons.statistics.scales import Margins
from comparisons.statistics.sides import Known, known_side, side_of
from comparisons.statistics.welch import BiasTest
from comparisons.statistics.wording import percent


def noise_free_candidate(
    reference: FloatArray | Known, margins: Margins | None = None, level: float = 1.0
) -> BiasTest | None:
    """The test of the image mean that a candidate equal to the reference, and without noise, would
    get: its `detectable` is the smallest bias that any candidate can show against this reference.

    reference: (R, height, width, 3), or known;  None if it is a single picture, whose noise is not
    known.
    """
    if not isinstance(reference, Known) and len(reference) < 2:
        return None
    side = known_side(reference) if isinstance(reference, Known) else side_of(reference)
    perfect = known_side(Known(side.mean, np.zeros_like(side.mean)))
    return image_test(side, perfect, margins or Margins(), level)


def wanted(
    image: BiasTest, limit: float, alone: BiasTest | None, least: float = 0.0
) -> tuple[str, float]:
    """How many more samples are needed, in words, and the factor.

    image: the test of this run;  alone: what the reference by itself allows, if only the
    candidate's samples can be raised; None if those of both sides can;  least: the factor that
    meets enough of the rare light.
    """
    if alone is None:
        factor = max(image.samples_factor(limit), least)
        return _times(factor, "replicates x {0} or spp x {0}"), factor
    factor = max(candidate_factor(image, alone, limit), least)
    if math.isfinite(factor) or not np.isfinite(image.samples_factor(limit)):
        return _times(factor, "the candidate's replicates x {0} or spp x {0}"), factor
    return _too_noisy_a_reference(alone, limit), factor


def shortfall(alone: BiasTest, limit: float) -> str:
    """Why no candidate can reach `limit` against this reference; "" if one can."""
    seen = alone.over_scale(alone.detectable).max()
    return _too_noisy_a_reference(alone, limit) if seen > limit else ""


def _too_noisy_a_reference(alone: BiasTest, limit: float) -> str:
    seen = float(alone.over_scale(alone.detectable).max())
    factor = alone.samples_factor(limit)
    more = _times(factor, "replicates x {0} or spp x {0}", "the reference's samples")
    if seen > limit:
        return (
            "the noise of the reference is the limit: even with a candidate without noise, a bias "
            f"below {percent(seen)} could be overlooked; {more}"
        )
    return (
        "the noise of the reference is the limit: the difference is too near to the limit to be "
        "decided against this reference, even by a candidate without noise"
    )


def candidate_factor(image: BiasTest, alone: BiasTest, limit: float) -> float:
    """The factor of the candidate's samples that suffices while the reference stays as it is;
    infinite if none does.  Squared errors of both sides add."""
    dof = min(float(np.min(error.dof)) for error in image.errors)
    cushion = (1.0 + 1.645 / math.sqrt(dof)) ** 2  # as in `BiasTest.samples_factor`
    margin = image.margin * image.scale
    reach, floor = image.detectable - margin, alone.detectable - margin
    inside = limit * image.scale - np.abs(image.difference)
    beyond = np.abs(image.difference) - margin
    goal = np.minimum(limit * image.scale - margin, np.maximum(inside, beyond))
    room = goal**2 - floor**2
    if not ((goal > 0.0) & (room > 0.0)).all():
        return math.inf
    return float(cushion * ratio(np.maximum(reach**2 - floor**2, 0.0), room).max())


def _times(factor: float, how: str, whose: str = "the samples") -> str:
    if not math.isfinite(factor):
        return "these pictures do not show how many samples are needed: give more replicates"
    times = f"{factor:.{0 if factor > 10 else 1}f}"
    return f"it takes about {times} times {whose}: {how.format(times)}"
