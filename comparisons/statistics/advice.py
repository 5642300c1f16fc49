"""Advice for a run that was too noisy: how many more samples are needed, and on which side.

The samples of both sides can be raised in a comparison of two renderers. At a gate only the
candidate's can: the reference may be a baseline of few replicates. If these alone are too noisy, no
candidate could show agreement, and the advice is about the reference.
"""

import bisect
import math

import numpy as np
from scipy import special

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import Margins
from comparisons.statistics.scales import IMAGE, Pair, image_test
from comparisons.statistics.sides import Known, known_side, side_of
from comparisons.statistics.unseen import unseen
from comparisons.statistics.welch import MOST_DOF, BiasTest, quantiles
from comparisons.statistics.wording import percent

FEW = 2.0
"""Replicates are called too few if more of them need so many times fewer samples than more samples
per pixel do."""

LITTLE = 1.1
"""Factors below it are said in words: an estimated factor is no more exact (`samples_factor`)."""

ENOUGH = 8.0
"""Degrees of freedom from which on more replicates are as good as more samples per pixel."""

MOST = 1e7
"""Factors beyond it are called infinite."""

_UNKNOWN = "these pictures do not show how many samples are needed: give more replicates"


def noise_free_candidate(
    reference: FloatArray | Known,
    margins: Margins | None = None,
    level: float = 1.0,
    signed: bool = False,
) -> BiasTest | None:
    """The test of the image mean that a candidate equal to the reference, and without noise, would
    get: its `detectable` is the smallest bias that any candidate can show against this reference.

    reference: (R, height, width, 3), or known;  None if it is a single picture, whose noise is not
    known.
    """
    if not isinstance(reference, Known) and len(reference) < 2:
        return None
    side = side_of(reference, signed)
    perfect = known_side(Known(side.mean, np.zeros_like(side.mean)), signed=signed)
    return image_test(Pair(side, perfect, margins or Margins()), level * IMAGE.level)


def replicates_asked(
    candidate: FloatArray,
    reference: FloatArray,
    limit: float,
    level: float = 1.0,
    signed: bool = False,
) -> int:
    """How many replicates of each side it takes to see a bias of `limit` with a chance of POWER, by
    the noise of these, and to meet enough of the rare light; their difference has no part in it.

    candidate, reference: replicates (R, height, width, 3), two or more;  level, signed: as in
    `compare`, of a look at so many.  The noise of few replicates is not known well: neither is the
    number.
    """
    a, b = side_of(candidate, signed), side_of(reference, signed)
    count, margins = min(a.count, b.count), Margins()
    image = image_test(Pair(a, b, margins), level * IMAGE.level)
    known = image.errors[:2]  # the third grows with the difference
    reach_of = quantiles(-math.expm1(math.log1p(-level * IMAGE.level) / image.difference.size))[1]
    goal = limit * image.scale - image.margin * image.scale
    largest = np.max([error.value for error in known], axis=0)
    normal = (float(reach_of[MOST_DOF]) * largest) ** 2 + image.rare * image.margin * image.scale
    sizes = (np.abs(x) if signed else x for x in (candidate, reference))
    missing = max(unseen(x, level * IMAGE.level).missing for x in sizes)

    def suffices(replicates: int) -> bool:
        factor = replicates / count
        half = 0.5 * image.rare / factor
        reaches = [half + np.sqrt(half**2 + normal / factor)]  # as `bias_test` has them
        for error in known:
            dof = np.clip(error.dof * (replicates - 1) / (count - 1), 1.0, MOST_DOF)
            reaches.append(reach_of[dof.astype(np.int64)] * error.value / math.sqrt(factor))
        return bool((np.max(reaches, axis=0) <= goal).all()) and missing <= limit * factor

    counts = range(2, int(MOST))
    return 2 + bisect.bisect_left(counts, True, key=suffices)


def wanted(
    image: BiasTest,
    limit: float,
    alone: BiasTest | None,
    level: float = 1.0,
    least: float = 0.0,
) -> tuple[str, float]:
    """How many more samples are needed, in words, and the factor of samples per pixel.

    image: the test of this run;  alone: what the reference by itself allows, if only the
    candidate's samples can be raised; None if those of both sides can;  level: that of the test;
    least: the factor that is needed anyway, infinite if it is unknown.
    """
    factor = max(image.samples_factor(limit), least)
    if not math.isfinite(factor):
        return _UNKNOWN, factor
    if alone is not None:
        factor = max(factor_needed(image, limit, alone, level, replicates=False), least)
    elif min(float(np.min(error.dof)) for error in image.errors) >= ENOUGH:
        return _times(factor, factor, ""), factor
    fewer = max(factor_needed(image, limit, alone, level, replicates=True), least)
    if not math.isfinite(fewer) and alone is not None:
        return _too_noisy_a_reference(alone, limit, level), fewer
    return _times(fewer, factor, "" if alone is None else " of the candidate"), factor


def shortfall(alone: BiasTest, limit: float, level: float = 1.0) -> str:
    """Why no candidate can reach `limit` against this reference; "" if one can."""
    seen = alone.over_scale(alone.detectable).max()
    return _too_noisy_a_reference(alone, limit, level) if seen > limit else ""


def _too_noisy_a_reference(alone: BiasTest, limit: float, level: float) -> str:
    seen = float(alone.over_scale(alone.detectable).max())
    if seen > limit:
        replicates = factor_needed(alone, limit, None, level, replicates=True)
        more = _times(replicates, alone.samples_factor(limit), " of the reference")
        return (
            "the noise of the reference is the limit: even with a candidate without noise, a bias "
            f"below {percent(seen)} could be overlooked; {more}"
        )
    return (
        "the noise of the reference is the limit: the difference is too near to the limit to be "
        "decided against this reference, even by a candidate without noise"
    )


def factor_needed(
    image: BiasTest, limit: float, alone: BiasTest | None, level: float, *, replicates: bool
) -> float:
    """The factor of replicates, or of samples per pixel of each, that will probably suffice;
    infinite if none does.

    More replicates also have more degrees of freedom: four replicates of which each tells little
    seem to need a hundred times the samples, and need five times the replicates.  Squared errors of
    both sides add.  Of few replicates neither the difference nor its error is known well: the
    difference counts as far as it exceeds two standard errors, and an error as much as is certain.
    alone, level: as in `wanted`.
    """
    known = _known(image)
    fixed = np.zeros_like(known) if alone is None else np.minimum(_known(alone), known)
    size = np.maximum(np.abs(image.difference) - 2.0 * known, 0.0)
    margin = image.margin * image.scale
    goal = np.minimum(
        limit * image.scale - margin, np.maximum(limit * image.scale - size, size - margin)
    )
    reach_of = quantiles(-math.expm1(math.log1p(-level * IMAGE.level) / image.difference.size))[1]

    def suffices(factor: float) -> bool:
        value = np.sqrt((known**2 - fixed**2) / factor + fixed**2)
        dof = [error.dof * (factor if replicates else 1.0) for error in image.errors]
        reach = [reach_of[np.clip(d, 1.0, MOST_DOF).astype(np.int64)] * value for d in dof]
        return bool((np.max(reach, axis=0) <= goal).all())

    factors = np.geomspace(1.0, MOST, 400).tolist()
    least = bisect.bisect_left(factors, True, key=suffices)  # the reach falls with the factor
    return float(factors[least]) if least < len(factors) else math.inf


def _known(test: BiasTest) -> FloatArray:
    """The largest of the lower bounds, at 95 %, of the standard errors."""
    bounds = [e.value * np.sqrt(e.dof / special.chdtri(e.dof, 0.05)) for e in test.errors]
    return np.asarray(np.max(bounds, axis=0))


def _times(replicates: float, samples: float, whose: str) -> str:
    if not math.isfinite(replicates):
        return _UNKNOWN
    if max(replicates, samples) < LITTLE:
        return f"slightly more samples{whose} suffice: a tenth more"
    spp = _number(samples)
    if samples > FEW * replicates:
        other = f", or {spp} times the samples per pixel of each" if samples < MOST else ""
        return (
            f"there are too few replicates: it takes about {_number(replicates)} times the "
            f"replicates{whose}{other}"
        )
    return f"it takes about {spp} times the samples{whose}: replicates x {spp} or spp x {spp}"


def _number(factor: float) -> str:
    return f"{factor:.{0 if factor > 10 else 1}f}"
