"""Causes recognised from the numbers of the deterministic rungs."""

from collections.abc import Sequence
from typing import Any

from comparisons.compare.diagnosis.misfit import REST
from comparisons.results.case import Cause, RungResult

ALMOST_ALL = 0.95
"""The fraction of mismatches of one kind from which that kind names the cause."""

CONSTANT = 0.02
"""Relative interquartile range up to which a ratio counts as constant."""

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
"""Name and description by the kinds of `comparisons.rungs.rays.rays`, in their order: the first
that applies is used."""


def of_rungs(rungs: Sequence[RungResult]) -> Cause | None:
    """The cause that the first broken rung shows; None if it shows none."""
    broken = next((rung for rung in rungs if rung.status == "differ"), None)
    if broken is None:
        return None
    if broken.name == "film":
        evidence = broken.reason
        return Cause("wrong filter or filter width", evidence, 1.0)
    if broken.name == "geometry":
        if broken.reason.startswith("the camera"):
            return None  # the pictures show in which way the camera differs
        return _of_geometry(broken.numbers)
    if broken.name == "direct":
        return _of_direct(broken.numbers)
    return None


def _of_geometry(numbers: dict[str, Any]) -> Cause | None:
    """The first kind that nearly all mismatches have.  Earlier kinds imply later ones: another
    distance implies another normal, not the reverse."""
    kinds, total = numbers.get("mismatches_by_kind"), numbers.get("mismatches", 0)
    if not kinds or not total:
        return None
    for kind, (name, what) in OF_KIND.items():
        count = kinds.get(kind, 0)
        if count > ALMOST_ALL * total:
            evidence = f"{count} of {total} rays that differ {what}"
            return Cause(name, evidence, count / total)
    return None


def _of_direct(numbers: dict[str, Any]) -> Cause | None:
    """From the ratio of our direct light to the reference's at differing hits: its median, its
    relative spread, and the spread of ratio times cosine at the surface."""
    ratio, spread = numbers.get("ratio_median"), numbers.get("ratio_spread")
    with_cosine = numbers.get("ratio_times_cosine_spread")
    if ratio is None or spread is None:
        return None
    if with_cosine is not None and with_cosine < min(CONSTANT, 0.5 * spread):
        evidence = "the candidate's direct light over the reference's is proportional to 1 / cosine"
        return Cause("missing cosine", evidence, 1.0 - with_cosine)
    # A factor that is nearly 1 explains nothing of what spreads further than it is from 1.
    if spread < min(CONSTANT, REST * abs(ratio - 1.0)):
        evidence = f"the candidate's direct light is {ratio:.4g} times the reference's at every hit"
        return Cause(f"direct light times {ratio:.4g}", evidence, 1.0 - spread)
    return None
