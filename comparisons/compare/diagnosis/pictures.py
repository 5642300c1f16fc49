"""The hypothesis that explains the difference of two pictures best, where one clearly does."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from comparisons.compare.diagnosis import brightness, colour, place, tones
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.compare.diagnosis.spots import SHARE, one_place, rim
from comparisons.results.case import Cause, FloatArray, Images
from comparisons.statistics.metrics import count_nonfinite

MOST = 0.6
"""The fraction of the squared difference beyond noise that a cause must explain at least."""

CLEARER = 0.7
"""A cause must leave at most this fraction of what the next best one leaves unexplained."""

NO_MATTER = 1e-3
"""Unexplained fractions below this are rounding, and do not distinguish hypotheses."""

PENALTY = 0.5
"""A hypothesis with more parameters must leave less than this fraction of what a simpler one leaves
unexplained: with fitted parameters it always leaves a little less."""


ALIKE = {"encoding": "gamma"}
"""A family, and one with as many parameters that fits nearly as well and is no rival of it."""


def likeliest(
    images: Images,
    lights: Mapping[str, FloatArray] | None = None,
    also: Callable[[FloatArray], Iterable[Hypothesis]] = lambda reference: (),
) -> Cause | None:
    """Name the one cause that explains most of the squared difference beyond noise, or None where
    nothing does so clearly.

    lights: the reference's pictures of single lights (height, width, 3), by name;  also: other
    hypotheses about a reference, rendered only if the difference is clear.
    """
    if images.candidate.shape != images.reference.shape:
        return None
    if count_nonfinite(images.candidate, images.reference):
        return None
    misfit = Misfit(images)
    if not (misfit.clear and misfit.excess > 0.0):
        return None
    hypotheses = [
        *brightness.hypotheses(misfit, lights or {}),
        *colour.hypotheses(misfit),
        *tones.hypotheses(misfit),
        *place.hypotheses(misfit),
        *also(misfit.reference),
    ]
    left = np.array([misfit.left(h.picture) for h in hypotheses])
    # Noise may leave less than nothing.
    left -= min(float(left.min()), 0.0)
    ranked = list(zip(hypotheses, left.tolist(), strict=True))
    best = _best(ranked, misfit.margin)
    reproduced = best is not None and misfit.reproduces(best[0].picture)
    at_border = rim(misfit)
    # A wrong rim changes no other pixel: what explains more of the difference is not of the rim,
    # nor is what predicts as much of it as must lie in a rim.
    enough = at_border is not None and 1.0 - left.min() >= at_border.explained
    enough = enough or (reproduced and best is not None and best[1] <= 1.0 - SHARE)
    if at_border is not None and not enough:
        return at_border
    if best is not None:
        hypothesis, unexplained = best
        if not reproduced:
            return None
        explained = 1.0 - unexplained
        evidence = (
            f"{hypothesis.evidence}: that explains {100.0 * explained:.4g} % of the difference"
        )
        return Cause(hypothesis.name, evidence, explained)
    if left.min() < 1.0 - MOST:
        return None  # several hypotheses explain it, none clearly better than the others
    return one_place(misfit)


def _best(ranked: list[tuple[Hypothesis, float]], margin: float) -> tuple[Hypothesis, float] | None:
    """The winner and what it leaves unexplained, if it wins clearly, by `margin` at least."""
    by_family: dict[str, tuple[Hypothesis, float]] = {}
    for hypothesis, left in ranked:
        known = by_family.get(hypothesis.family)
        if known is None or left < known[1]:
            by_family[hypothesis.family] = hypothesis, left
    simplest_first = sorted(by_family.values(), key=lambda one: (one[0].parameters, one[1]))
    winner = simplest_first[0]
    for other in simplest_first[1:]:
        fewer = winner[0].parameters < other[0].parameters
        less = other[1] < (PENALTY if fewer else 1.0) * winner[1]
        if less and winner[1] - other[1] > max(NO_MATTER, margin if fewer else 0.0):
            winner = other
    if winner[1] > 1.0 - MOST:
        return None
    # One with more parameters is no rival: it would have won, did it leave clearly less.
    own = winner[0].family
    rivals = [
        left
        for hypothesis, left in by_family.values()
        if hypothesis.family not in (own, ALIKE.get(own))
        and hypothesis.parameters <= winner[0].parameters
    ]
    next_one = min(rivals, default=1.0)
    clear = max(winner[1], NO_MATTER) <= CLEARER * next_one and next_one - winner[1] > margin
    return winner if clear else None
