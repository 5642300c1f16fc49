"""Rungs of light that differ because Mitsuba's precision does not resolve the scene."""

from collections.abc import Sequence
from dataclasses import replace

from comparisons.results.case import RungResult
from comparisons.results.rungs import OF_LIGHT, RUNGS
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.resolution import Resolution


def limited(rungs: Sequence[RungResult]) -> list[RungResult]:
    """The results, with `differ` of a rung of light changed to `reference-limited` where Mitsuba
    does not resolve the scene: the difference then shows its precision, not a fault of ours.

    Mitsuba does not resolve a scene if geometry agrees but, by prediction and by measurement, too
    many secondary rays hit the wrong surface (see `rays.resolution`).  Nor does it above a rung in
    which the arbiter finds too many rays that float32 cannot resolve, or above statistics that its
    ray epsilon explains.
    """
    results: list[RungResult] = []
    limit = ""
    for result in sorted(rungs, key=lambda result: RUNGS.index(result.name)):
        if limit and result.name in OF_LIGHT and result.status == "differ":
            result = replace(result, status="reference-limited", reason=f"{limit}; {result.reason}")
        limit = limit or _limit(result)
        results.append(result)
    return results


def _limit(result: RungResult) -> str:
    """Why Mitsuba's precision is too low, by the result of one rung; empty where it is not."""
    if "ray_epsilon" in result.numbers:  # see `comparisons.compare.ray_starts`
        return result.reason
    if result.status not in ("agree", "reference-limited"):
        return ""
    if result.name == "geometry" and "resolution" in result.numbers:
        resolution = Resolution(**result.numbers["resolution"])
        if resolution.is_limited:
            return resolution.description
    count = {"geometry": "rays", "direct": "rays", "whitted": "pixels"}.get(result.name)
    if result.status == "agree" or count is None:
        return ""
    total = result.numbers[count] - result.numbers.get("aimed_rays", 0)
    if arbiter.too_many(result.numbers["explained"], total):
        return f"{result.name}: {result.reason}"
    return ""
