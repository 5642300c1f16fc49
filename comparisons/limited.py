"""Rungs of light that break because the reference cannot resolve the scene."""

from collections.abc import Sequence
from dataclasses import replace

from comparisons.results import Tier
from comparisons.tiers.resolution import Resolution

OF_LIGHT = ("direct", "whitted", "statistics", "images")


def limited(rungs: Sequence[Tier]) -> list[Tier]:
    """The rungs, of which those of light that differ are `reference-limited` where the rung of
    geometry holds, and a share of hits that is too large is foretold, and found, to be left by
    Mitsuba for something else than what is there: see `tiers.resolution`.

    Such a picture says nothing about ours: what is seen from surfaces is Mitsuba's precision.
    """
    geometry = next((tier for tier in rungs if tier.name == "geometry"), None)
    if geometry is None or geometry.status not in ("agree", "reference-limited"):
        return list(rungs)
    numbers = geometry.numbers.get("resolution")
    if numbers is None or not Resolution(**numbers).is_limited:
        return list(rungs)
    told = Resolution(**numbers).told
    return [
        replace(tier, status="reference-limited", reason=f"{told}; {tier.reason}")
        if tier.name in OF_LIGHT and tier.status == "differ"
        else tier
        for tier in rungs
    ]


__all__ = ["limited"]
