"""The hypothesis that explains the difference of two pictures best, where one clearly does."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from comparisons.compare.diagnosis import brightness, place
from comparisons.compare.diagnosis.colour import A_MATRIX
from comparisons.compare.diagnosis.contest import Fitted, contenders, possible
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import NO_MATTER, REST, Misfit
from comparisons.compare.diagnosis.pairs import COLOURS, pairs
from comparisons.compare.diagnosis.spots import (
    FEW_PIXELS,
    ONE_PIXEL,
    ONE_TILE,
    SHARE,
    one_place,
    rim,
)
from comparisons.compare.diagnosis.tones import A_CURVE
from comparisons.results.case import Cause, FloatArray, Images
from comparisons.statistics.metrics import count_nonfinite

MOST = 0.6
"""The fraction of the squared difference beyond noise that a cause must explain at least."""

CLEARER = 0.7
"""A cause must leave at most this fraction of what the next best one leaves unexplained."""

PENALTY = 0.5
"""A hypothesis with more parameters must leave less than this fraction of what a simpler one leaves
unexplained: with fitted parameters it always leaves a little less."""


SIMPLE = 1
"""A cause is named in part only with so many parameters: with more it fits what it is not."""

ALIKE = {"encoding": "gamma"}
"""A family, and one with as many parameters that fits nearly as well and is no rival of it."""


IN_PART = "in part: "
"""Begins the name of a cause that leaves more than noise."""


SURE = 0.995
"""The fraction of the squared difference that a cause must explain for others not to be rendered.
If nearly all light is lost, a gain near 0 explains 0.99 of it (measured: a ball under a sky)."""

INTERPOLATED = 0.01
"""Unexplained fractions of what positions change, below which interpolation does not distinguish
causes."""

UNSURE = (A_CURVE, A_MATRIX, ONE_TILE, FEW_PIXELS, ONE_PIXEL)
"""Causes that others look like, which a scene must be rendered for: the former have so many
parameters that they may fit what has a simpler cause, and a small shadow lies in one place."""


def is_sure(cause: Cause | None) -> bool:
    """Whether nothing need be rendered to find a likelier cause."""
    if cause is None or cause.explained <= SURE or cause.name.startswith(IN_PART):
        return False
    return not cause.name.endswith(UNSURE)


class Fits:
    """What is fitted to two pictures without rendering, once for several calls of `likeliest`."""

    def __init__(self, images: Images) -> None:
        self._images = images

    @cached_property
    def misfit(self) -> Misfit:
        return Misfit(self._images)

    @cached_property
    def singles(self) -> list[Fitted]:
        """Hypotheses about colours or positions that the sample leaves possible."""
        small = self.misfit.sampled()
        colours = contenders(COLOURS, small, lambda: self.misfit)
        found = list(possible([*colours, *place.fits(self.misfit, small)]))
        return [*found, *((one, self.misfit) for one in place.sharpened(self.misfit))]

    @cached_property
    def two(self) -> "list[_Ranked]":
        """Two causes together that leave no more than noise."""
        return _simple([one for one in _ranked(pairs(self.misfit)) if one.is_whole])


def likeliest(
    images: Images,
    lights: Mapping[str, FloatArray] | None = None,
    also: Callable[[FloatArray], Iterable[Hypothesis]] = lambda reference: (),
    fits: Fits | None = None,
) -> Cause | None:
    """Name the one cause that explains most of the squared difference beyond noise, or None where
    nothing does so clearly.

    lights: the reference's pictures of single lights (height, width, 3), by name;  also: other
    hypotheses about a reference, rendered only if the difference is clear;  fits: of the same
    pictures, from an earlier call.
    """
    if images.candidate.shape != images.reference.shape:
        return None
    if count_nonfinite(images.candidate, images.reference):
        return None
    fits = fits or Fits(images)
    misfit = fits.misfit
    if not (misfit.clear and misfit.excess > 0.0):
        return None
    singles = [
        *(one for one in fits.singles if not (lights and brightness.is_of_light(one[0], misfit))),
        *((one, misfit) for one in brightness.of_lights(misfit, lights or {})),
        *_rendered(misfit, also(misfit.reference)),
    ]
    ranked = _ranked(singles)
    whole = _simple([one for one in ranked if one.is_whole])
    at_border = rim(misfit)
    # A wrong rim changes no other pixel: what explains more of the difference is not of the rim,
    # nor is what predicts as much of it as must lie in a rim.
    best = _best(whole or ranked, misfit.margin)
    least = min(one.left for one in ranked)
    enough = at_border is not None and 1.0 - least >= at_border.explained
    enough = enough or (best is not None and best.is_reproduced and best.left <= 1.0 - SHARE)
    if at_border is not None and not enough:
        return at_border
    if all(one.is_flexible for one in whole):
        two = fits.two
        both = _best(two, max(two[0].seen.margin, INTERPOLATED)) if two else None
        if both is not None and both.is_reproduced and not (whole and both.is_flexible):
            return both.cause(of=misfit)
    if whole:
        # Several may explain it, none clearly better than the others.
        return None if best is None or not best.is_reproduced else best.cause()
    simple = [one for one in ranked if one.hypothesis.parameters <= SIMPLE]
    part = _best(simple, misfit.margin)
    if part is not None and part.left <= REST and part.is_reproduced:
        return one_place(misfit) or part.cause()
    return one_place(misfit)


def _rendered(
    misfit: Misfit, hypotheses: Iterable[Hypothesis]
) -> Iterator[tuple[Hypothesis, Misfit]]:
    """Those whose own noise does not hide the difference."""
    for one in hypotheses:
        seen = misfit if one.noise is None else misfit.noisier(one.noise)
        if seen.clear and seen.excess > 0.0:
            yield one, seen


@dataclass(frozen=True)
class _Ranked:
    """left: the unexplained fraction;  is_whole: nothing but noise is left;  seen: what compares
    it."""

    hypothesis: Hypothesis
    seen: Misfit
    left: float
    is_whole: bool

    @property
    def is_flexible(self) -> bool:
        """Whether it has so many parameters that it may fit what has a simpler cause."""
        return self.hypothesis.name.endswith((A_CURVE, A_MATRIX))

    @cached_property
    def is_reproduced(self) -> bool:
        return self.seen.reproduces(self.hypothesis.picture)

    def cause(self, of: Misfit | None = None) -> Cause:
        """of: what explains a part of it, if not `seen`."""
        one = self.hypothesis
        explained = 1.0 - (self.left if of is None else max(of.left(one.picture), 0.0))
        evidence = f"{one.evidence}: that explains {100.0 * explained:.4g} % of the difference"
        if self.is_whole:
            return Cause(one.name, evidence, explained)
        evidence += ", and what is left is more than noise: something else differs, too"
        return Cause(f"{IN_PART}{one.name}", evidence, explained)


def _simple(ranked: list[_Ranked]) -> list[_Ranked]:
    """Without curves and matrices of many parameters, if there are others: these average noise, and
    so leave less of it than what is right."""
    few = [one for one in ranked if not one.is_flexible]
    return few or ranked


def _ranked(hypotheses: Iterable[tuple[Hypothesis, Misfit]]) -> list[_Ranked]:
    found = []
    for one, seen in hypotheses:
        left = seen.left(one.picture)
        found.append(_Ranked(one, seen, left, left <= 1.0 - MOST and seen.is_whole(one)))
    # Noise may leave less than nothing.
    least = min([0.0, *(one.left for one in found)])
    return [replace(one, left=one.left - least) for one in found]


def _best(ranked: list[_Ranked], margin: float) -> _Ranked | None:
    """The winner, if it wins clearly, by `margin` at least."""
    by_family: dict[str, _Ranked] = {}
    for one in ranked:
        known = by_family.get(one.hypothesis.family)
        if known is None or _is_better(one, known, margin):
            by_family[one.hypothesis.family] = one
    simplest_first = sorted(by_family.values(), key=lambda x: (x.hypothesis.parameters, x.left))
    if not simplest_first:
        return None
    winner = simplest_first[0]
    for other in simplest_first[1:]:
        if _is_better(other, winner, margin):
            winner = other
    if winner.left > 1.0 - MOST:
        return None
    # One with more parameters is no rival: it would have won, did it leave clearly less.
    own = winner.hypothesis
    rivals = [
        one.left
        for family, one in by_family.items()
        if family not in (own.family, ALIKE.get(own.family))
        and one.hypothesis.parameters <= own.parameters
    ]
    next_one = min(rivals, default=1.0)
    clear = max(winner.left, NO_MATTER) <= CLEARER * next_one and next_one - winner.left > margin
    return winner if clear else None


def _is_better(one: _Ranked, than: _Ranked, margin: float) -> bool:
    """Whether it leaves less, and clearly so if it has more parameters."""
    fewer = than.hypothesis.parameters < one.hypothesis.parameters
    less = one.left < (PENALTY if fewer else 1.0) * than.left
    return less and than.left - one.left > max(NO_MATTER, margin if fewer else 0.0)
