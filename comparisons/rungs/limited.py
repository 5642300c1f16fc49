"""Rungs of light that differ because Mitsuba's precision does not resolve the scene.

A limit excuses what it can explain, and no more: rays by their own geometry, pictures by what is
left of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from comparisons.results.case import PASSING, RungResult, Status
from comparisons.results.rungs import OF_LIGHT, RUNGS
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.resolution import Resolution


class Limit(NamedTuple):
    """What a rung says of Mitsuba's precision.

    reason: in words;  share: of how many rays, at most, it changes what they meet: the upper end of
    the confidence interval.
    """

    reason: str
    share: float


class Rest(NamedTuple):
    """What is left of two pictures that differ without that which a limit explains.  status:
    `agree`, `differ`, or `inconclusive` if too little is left;  reason: in words."""

    status: Status
    reason: str


RestOf = Callable[[float], Rest]
"""The rest of the pictures of a case, by the share of the limit."""


def limited(rungs: Sequence[RungResult], rest_of: RestOf | None = None) -> list[RungResult]:
    """The results, with `differ` of a rung of light changed to `reference-limited` where Mitsuba
    does not resolve the scene, and this explains what differs.  Above a rung that differs even so
    nothing is excused.

    Mitsuba does not resolve a scene if geometry agrees but, by prediction and by measurement, too
    many secondary rays hit the wrong surface (see `rays.resolution`), nor above a rung in which the
    arbiter finds too many rays that float32 cannot resolve.  That explains values of single rays
    only if each of these rays is beyond precision by its own geometry: `numbers["elsewhere"]`
    counts the others, `numbers["explained_elsewhere"]` those that the arbiter explains, if they are
    too many.  It explains pictures only if they agree without it: `rest_of`.
    """
    results: list[RungResult] = []
    limit: Limit | None = None
    pictures: Rest | None = None
    is_broken = False
    for result in sorted(rungs, key=lambda result: RUNGS.index(result.name)):
        if limit and not is_broken and result.name in OF_LIGHT and result.status == "differ":
            if result.name in OF_RAYS:
                result = _judged(result, limit, _of_rays(result))
            elif rest_of is not None:
                pictures = pictures or rest_of(limit.share)
                result = _judged(result, limit, pictures)
        limit = limit or _limit(result)
        is_broken |= result.status == "differ"
        results.append(result)
    return results if any(_says(result) for result in results) else [_open(r) for r in results]


def _says(result: RungResult) -> bool:
    """Whether a rung of light has found that enough agrees."""
    says = result.name in OF_LIGHT and result.numbers.get("tells", True)
    return says and result.status in PASSING


def _open(result: RungResult) -> RungResult:
    """A result in which too little agrees to rest on, where no other rung has more."""
    if result.status not in PASSING or result.numbers.get("tells", True):
        return result
    reason = f"too little is within Mitsuba's precision to judge by: {result.reason}"
    return replace(result, status="inconclusive", reason=reason)


OF_RAYS = ("direct", "whitted")
"""The rungs of light that compare single rays."""


def _judged(result: RungResult, limit: Limit, rest: Rest) -> RungResult:
    """The result of a rung that differs, by what is left of it."""
    if rest.status == "agree":
        reason = f"{limit.reason}; {rest.reason}; {result.reason}"
        return replace(result, status="reference-limited", reason=reason)
    return replace(result, status=rest.status, reason=f"{result.reason}; {rest.reason}")


def _of_rays(result: RungResult) -> Rest:
    """What is left of the values of single rays."""
    numbers = result.numbers
    others = numbers.get("elsewhere", numbers["unexplained"])
    others += numbers.get("explained_elsewhere", 0) + numbers.get("of_another_tree", 0)
    if others:
        return Rest("differ", f"{others} of them are not beyond Mitsuba's precision")
    return Rest("agree", "each of these rays is beyond it")


def _limit(result: RungResult) -> Limit | None:
    """The limit of Mitsuba's precision that one rung shows; None where it shows none."""
    if result.status not in ("agree", "reference-limited"):
        return None
    if result.name == "geometry" and "resolution" in result.numbers:
        found = Resolution(**result.numbers["resolution"])
        if found.is_limited:
            return Limit(found.description, arbiter.most_of(found.found, found.hits))
    count = {"geometry": "rays", "direct": "rays", "whitted": "pixels"}.get(result.name)
    if result.status == "agree" or count is None:
        return None
    total = result.numbers[count] - result.numbers.get("aimed_rays", 0)
    explained = result.numbers["explained"]
    if arbiter.too_many(explained, total):
        share = arbiter.most_of(explained, total)
        return Limit(f"{result.name}: {result.reason}", share)
    return None
