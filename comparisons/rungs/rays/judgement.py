"""Which tracer's hit is wrong where they differ: exact arithmetic decides."""

from typing import NamedTuple

import numpy as np

from comparisons.mitsuba.hits import MitsubaHits
from comparisons.referee.referee import Referee, identity_of
from comparisons.rungs.rays.rays import Rays
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.rendering.query import Intersections

MOST_JUDGED = 400
"""Most mismatches that are judged: each takes about 10 ms."""

SHARE = 1e-6
"""Tolerance of Mitsuba's t, as a fraction of the distance and over the cosine: the question is only
which surface was hit.  A thousandth of it is the tolerance of our t (`_slack`)."""


class Judgement(NamedTuple):
    """Indices of the rays on which the tracers disagree, by whose hit is wrong.

    ours: our hit is wrong;  mitsuba: only Mitsuba's is;  both: neither is, the two surfaces are in
    one place;  undecided: both hits are of the right surface, and the difference is elsewhere, or
    the ray touches an edge exactly, or it is beyond MOST_JUDGED.
    """

    ours: IntArray
    mitsuba: IntArray
    both: IntArray
    undecided: IntArray


def judged(
    referee: Referee, rays: Rays, ours: Intersections, theirs: MitsubaHits, mismatches: IntArray
) -> Judgement:
    """Judge the rays with the indices `mismatches`, in their order."""
    some = mismatches[:MOST_JUDGED]
    truths = referee.decide(rays.o[some], rays.d[some]) if len(some) else []
    verdicts = []
    for k, truth in zip(some.tolist(), truths, strict=True):
        right = truth.agrees(ours, k, _slack(rays, ours, k))
        also = truth.agrees(theirs, k, 1e3 * _slack(rays, theirs, k))
        apart = identity_of(ours, k) != identity_of(theirs, k)
        verdicts.append(("both" if apart else "undecided") if right and also else
                        "mitsuba" if right else
                        "undecided" if truth.touching else "ours")  # fmt: skip
    named = np.array(verdicts + ["undecided"] * (len(mismatches) - len(some)), dtype="U9")
    return Judgement(*(mismatches[named == name] for name in Judgement._fields))


def _slack(rays: Rays, hits: Intersections, k: int) -> float:
    d = rays.d[k]
    length: float = float(np.linalg.norm(d))
    cosine = abs(float(hits.n[k] @ d)) / length
    scale = max(_largest(rays.o[k]), _largest(hits.p[k]))
    return SHARE * 1e-3 * scale / length / max(cosine, 1e-6)


def _largest(v: FloatArray) -> float:
    return float(np.abs(v).max())
