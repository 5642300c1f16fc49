"""Rungs of light that differ because Mitsuba's precision does not resolve the scene."""

from collections.abc import Sequence
from dataclasses import replace

from comparisons.results.case import RUNGS, Tier
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.resolution import Resolution

OF_LIGHT = ("direct", "whitted", "statistics", "images")


def limited(rungs: Sequence[Tier]) -> list[Tier]:
    """The results, with `differ` of a rung of light changed to `reference-limited` where Mitsuba
    does not resolve the scene: the difference then shows its precision, not a fault of ours.

    Mitsuba does not resolve a scene if geometry agrees but, by prediction and by measurement, too
    many secondary rays hit the wrong surface (see `rays.resolution`).  Nor does it above a rung in
    which the arbiter finds too many rays that float32 cannot resolve.
    """
    found: list[Tier] = []
    limit = ""
    for tier in sorted(rungs, key=lambda tier: RUNGS.index(tier.name)):
        if limit and tier.name in OF_LIGHT and tier.status == "differ":
            tier = replace(tier, status="reference-limited", reason=f"{limit}; {tier.reason}")
        limit = limit or _limit(tier)
        found.append(tier)
    return found


def _limit(tier: Tier) -> str:
    """Why Mitsuba's precision is too low, by the result of one rung; empty where it is not."""
    if tier.status not in ("agree", "reference-limited"):
        return ""
    if tier.name == "geometry" and "resolution" in tier.numbers:
        resolution = Resolution(**tier.numbers["resolution"])
        if resolution.is_limited:
            return resolution.description
    count = {"geometry": "rays", "direct": "rays", "whitted": "pixels"}.get(tier.name)
    if tier.status == "agree" or count is None:
        return ""
    total = tier.numbers[count] - tier.numbers.get("aimed_rays", 0)
    if arbiter.too_many(tier.numbers["explained"], total):
        return f"{tier.name}: {tier.reason}"
    return ""


__all__ = ["limited"]
