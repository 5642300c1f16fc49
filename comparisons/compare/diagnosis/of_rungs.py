"""Causes that the deterministic rungs recognise."""

from collections.abc import Sequence
from typing import Any

from comparisons.results.case import Cause, Tier

ALMOST_ALL = 0.95
"""Of the mismatches of a kind, to be told as all of them."""

CONSTANT = 0.02
"""Relative spread (between quartiles) of a ratio that is one number."""

OF_KIND = {
    "hit": ("missing or additional surface", "hit in one and miss in the other"),
    "shape": ("another shape in front", "meet another shape"),
    "instance": ("another instance in front", "meet another instance"),
    "part": ("another part in front", "meet another part of a shape"),
    "primitive": ("missing or exchanged faces", "meet another face of a shape"),
    "t": ("moved or resized surface", "meet the same surface at another distance"),
    "normal": ("wrong normal", "meet the same point with another normal"),
    "shading_normal": ("wrong shading normal", "meet the same point with another shading normal"),
    "uv": ("wrong texture coordinates", "meet the same point with other uv"),
}
"""By the kinds of `comparisons.rungs.rays.comparer`, in their order: the first of several
counts."""


def of_rungs(tiers: Sequence[Tier]) -> Cause | None:
    """What the first rung that broke says about the cause, None where it does not."""
    broken = next((tier for tier in tiers if tier.status == "differ"), None)
    if broken is None:
        return None
    if broken.name == "film":
        told = broken.reason
        return Cause("wrong filter or filter width", told, 1.0)
    if broken.name == "geometry":
        if broken.reason.startswith("the camera"):
            return None  # what kind of other camera, the pictures show
        return _of_geometry(broken.numbers)
    if broken.name == "direct":
        return _of_direct(broken.numbers)
    return None


def _of_geometry(numbers: dict[str, Any]) -> Cause | None:
    """By what most mismatches are about.  A wrong normal is no other distance: what comes first in
    the order of kinds is what the others follow from."""
    kinds, total = numbers.get("mismatches_by_kind"), numbers.get("mismatches", 0)
    if not kinds or not total:
        return None
    for kind, (name, what) in OF_KIND.items():
        count = kinds.get(kind, 0)
        if count > ALMOST_ALL * total:
            told = f"{count} of {total} rays that differ {what}"
            return Cause(name, told, count / total)
    return None


def _of_direct(numbers: dict[str, Any]) -> Cause | None:
    """From the ratios of our direct light to the reference's at hits that differ: its median, its
    relative spread, and the spread of the ratio times the cosine at the surface."""
    ratio, spread = numbers.get("ratio_median"), numbers.get("ratio_spread")
    with_cosine = numbers.get("ratio_times_cosine_spread")
    if ratio is None or spread is None:
        return None
    if with_cosine is not None and with_cosine < CONSTANT and with_cosine < 0.5 * spread:
        told = "the candidate's direct light over the reference's goes as one over the cosine"
        return Cause("missing cosine", told, 1.0 - with_cosine)
    if spread < CONSTANT:
        told = f"the candidate's direct light is {ratio:.4g} times the reference's at every hit"
        return Cause(f"direct light times {ratio:.4g}", told, 1.0 - spread)
    return None
