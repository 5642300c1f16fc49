"""Which causes a sample of the pixels leaves possible: only these are fitted to the whole picture,
and judged there."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.results.case import FloatArray

Fitted = tuple[Hypothesis, Misfit]
"""A hypothesis and the misfit that it was fitted to, which compares what it can know."""

Fit = Callable[[Misfit], Iterable[Hypothesis]]

TWICE = 2.0
"""A cause cannot be if it leaves more than so many times what another leaves with as many
parameters or fewer."""

UNCLEAR = 0.01
"""Nor where that is less than so much of the difference: interpolation leaves it."""

HOPELESS = 0.6
"""A cause that leaves more of the difference neither is named nor is a rival of one that is."""

SURELY = 5.0
"""Standard errors by which that must be so in the sample."""

BEST = 3
"""So many of those that leave least are held against the others."""


@dataclass(frozen=True)
class Contender:
    """early: what was fitted to the sample;  whole: fits it to the whole picture."""

    early: Sequence[Fitted]
    whole: Callable[[], Iterable[Fitted]]


def contenders(
    fits: Iterable[Fit], small: Misfit, whole: Callable[[], Misfit]
) -> Iterator[Contender]:
    """small: of the sample;  whole: of the picture."""

    def contender(fit: Fit) -> Contender:
        early = [(one, small) for one in fit(small)]
        return Contender(
            early,
            lambda: early if whole() is small else [(one, whole()) for one in fit(whole())],
        )

    return map(contender, fits)


def possible(found: Sequence[Contender]) -> Iterator[Fitted]:
    """Of those of which the sample does not show, at every scale, that they leave too much: what is
    fitted to the whole picture."""
    early = [[_Left(*one) for one in contender.early] for contender in found]
    known = [one for each in early for one in each if one.shares]
    known.sort(key=lambda one: sum(float(share.sum()) for share in one.shares))
    for contender, each in zip(found, early, strict=True):
        if not all(one.is_beaten(known) for one in each):
            yield from contender.whole()


class _Left:
    """What a hypothesis leaves of the sample."""

    def __init__(self, hypothesis: Hypothesis, misfit: Misfit) -> None:
        self.parameters = hypothesis.parameters
        self.shares = misfit.shares(hypothesis.picture)

    def is_beaten(self, known: Sequence["_Left"]) -> bool:
        """known: those that leave least first."""
        if not self.shares:
            return False
        if all(_is_above(share, HOPELESS) for share in self.shares):
            return True
        rivals = [one for one in known if one.parameters <= self.parameters and one is not self]
        return any(
            all(
                _is_above(own - TWICE * other, UNCLEAR)
                for own, other in zip(self.shares, rival.shares, strict=True)
            )
            for rival in rivals[:BEST]
        )


def _is_above(shares: FloatArray, limit: float) -> bool:
    """Whether the sum is above the limit, for certain."""
    error = math.sqrt(shares.size) * float(shares.std())
    return float(shares.sum()) - limit > SURELY * error
