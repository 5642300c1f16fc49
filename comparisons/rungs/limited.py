"""Rungs of light that break because the reference cannot resolve the scene."""

from collections.abc import Sequence
from dataclasses import replace

from comparisons.results.case import RUNGS, Tier
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.resolution import Resolution

OF_LIGHT = ("direct", "whitted", "statistics", "images")


def limited(rungs: Sequence[Tier]) -> list[Tier]:
    """The rungs, of which those of light that differ are `reference-limited` where the scene is
    beyond what Mitsuba resolves: what is seen from surfaces is its precision, and says nothing
    about ours.

    It is where the rung of geometry holds, and a share of hits that is too large is foretold, and
    found, to be left for something else than what is there (see `tiers.resolution`); and above a
    rung in which the arbiter finds a share of rays that is too large to be unresolved.
    """
    found: list[Tier] = []
    told = ""
    for tier in sorted(rungs, key=lambda tier: RUNGS.index(tier.name)):
        if told and tier.name in OF_LIGHT and tier.status == "differ":
            tier = replace(tier, status="reference-limited", reason=f"{told}; {tier.reason}")
        told = told or _limit(tier)
        found.append(tier)
    return found


def _limit(tier: Tier) -> str:
    """What of the reference's precision a rung has shown; nothing where it is good enough."""
    if tier.status not in ("agree", "reference-limited"):
        return ""
    if tier.name == "geometry" and "resolution" in tier.numbers:
        resolution = Resolution(**tier.numbers["resolution"])
        if resolution.is_limited:
            return resolution.told
    count = {"geometry": "rays", "direct": "rays", "whitted": "pixels"}.get(tier.name)
    if tier.status == "agree" or count is None:
        return ""
    total = tier.numbers[count] - tier.numbers.get("aimed_rays", 0)
    if arbiter.too_many(tier.numbers["explained"], total):
        return f"{tier.name}: {tier.reason}"
    return ""


__all__ = ["limited"]
