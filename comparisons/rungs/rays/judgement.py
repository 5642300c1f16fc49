"""Whose fault a mismatch is: exact arithmetic decides."""

from typing import NamedTuple

import numpy as np

from comparisons.geometry.exact.referee import Referee
from comparisons.mitsuba.hits import Answers
from comparisons.rungs.rays.rays import Rays
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.query import Intersections

MOST_JUDGED = 400
"""Mismatches that are judged: some 10 ms each."""

FEW = 1e-4
"""The fraction of rays, not aimed at edges, that Mitsuba may get wrong by itself.  More is no
matter of rounding: its scene is another."""

SHARE = 1e-6
"""How far, as a fraction of the distance and over the cosine, our t may be from the exact one where
only the question is which surface it belongs to: a thousandth of what float32 could tell."""


class Judgement(NamedTuple):
    """Rays on which the two disagree: whose answer is not the exact one (numbers of rays).

    ours: ours, whatever Mitsuba's is;  mitsuba: Mitsuba's alone;  undecided: neither, as what
    differs is not which surface is met where, or all that do not fit MOST_JUDGED.
    """

    ours: IntArray
    mitsuba: IntArray
    undecided: IntArray


def judged(
    referee: Referee, rays: Rays, ours: Intersections, theirs: Answers, mismatches: IntArray
) -> Judgement:
    """Decides on mismatches, in their order."""
    some = mismatches[:MOST_JUDGED]
    truths = referee.decide(rays.o[some], rays.d[some]) if len(some) else []
    verdicts = []
    for k, truth in zip(some.tolist(), truths, strict=True):
        right = truth.agrees(ours, k, _slack(rays, ours, k))
        also = truth.agrees(theirs, k, 1e3 * _slack(rays, theirs, k))
        verdicts.append("undecided" if right and also else "mitsuba" if right else
                        "undecided" if truth.touching else "ours")  # fmt: skip
    named = np.array(verdicts + ["undecided"] * (len(mismatches) - len(some)), dtype="U9")
    return Judgement(*(mismatches[named == name] for name in ("ours", "mitsuba", "undecided")))


def _slack(rays: Rays, hits: Intersections, k: int) -> float:
    d = rays.d[k]
    length: float = float(np.linalg.norm(d))
    cosine = abs(float(hits.n[k] @ d)) / length
    scale = max(_largest(rays.o[k]), _largest(hits.p[k]))
    return SHARE * 1e-3 * scale / length / max(cosine, 1e-6)


def _largest(v: FloatArray) -> float:
    return float(np.abs(v).max())
