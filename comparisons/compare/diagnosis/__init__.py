"""Diagnosis: the likeliest cause of a difference, if one can be recognised.

`of_rungs` recognises causes from the numbers of the deterministic rungs.  `likeliest` fits each
`Hypothesis` (gain, gamma, shift, lost light, ...) to the pictures and returns the one that explains
most of the squared difference beyond noise, if it is clearly better than the others; otherwise the
one place (row, tile, pixels) that holds the difference, or None.  A cause must also reproduce the
bias of each channel's mean, and those of blocks (`Misfit.reproduces`).

To add a hypothesis, yield it from `brightness`, `colour` or `place`: the picture that the candidate
would be, and how many parameters were fitted.  A family that it is a special case of goes into
`GENERALISED`."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from comparisons.compare.diagnosis import brightness, colour, place
from comparisons.compare.diagnosis.misfit import Hypothesis, Misfit
from comparisons.compare.diagnosis.spots import SHARE, one_place, rim
from comparisons.results.case import Cause, FloatArray, Images, RungResult
from comparisons.statistics.metrics import count_nonfinite

__all__ = ["FLEXIBLE", "likeliest", "of_rungs"]

FLEXIBLE = (colour.A_CURVE, colour.A_MATRIX)


# ---- causes recognised from the numbers of the deterministic rungs -------------------------------


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
    if with_cosine is not None and with_cosine < CONSTANT and with_cosine < 0.5 * spread:
        evidence = "the candidate's direct light over the reference's is proportional to 1 / cosine"
        return Cause("missing cosine", evidence, 1.0 - with_cosine)
    if spread < CONSTANT:
        evidence = f"the candidate's direct light is {ratio:.4g} times the reference's at every hit"
        return Cause(f"direct light times {ratio:.4g}", evidence, 1.0 - spread)
    return None


# The hypothesis that explains the difference of two pictures best, where one clearly does.


MOST = 0.6
"""The fraction of the squared difference beyond noise that a cause must explain at least."""

CLEARER = 0.7
"""A cause must leave at most this fraction of what the next best one leaves unexplained."""

NO_MATTER = 1e-3
"""Unexplained fractions below this are rounding, and do not distinguish hypotheses."""

PENALTY = 0.5
"""A hypothesis with more parameters must leave less than this fraction of what a simpler one leaves
unexplained: with fitted parameters it always leaves a little less."""


_TONE = {"power", "tone curve"}

GENERALISED = {
    "gain": {"gains", "matrix", *_TONE},
    "gain of a channel": {"gains", "matrix"},
    "gains": {"matrix"},
    "channels": {"gains", "matrix"},
    "known matrix": {"saturation", "matrix"},
    "saturation": {"matrix"},
    "offset": {"tone curve"},
    "gamma": _TONE,
    "encoding": {"gamma", *_TONE},
    "sRGB": {"gamma", "encoding", *_TONE},
    "known curve": {"encoding", *_TONE},
    "power": {"tone curve"},
    "clamped": {"tone curve"},
    "8 bits": {"encoding", "tone curve"},
    "zoom": {"distortion", "aberration"},
}
"""A family's generalisations, which fit as well and are therefore not its rivals."""


def likeliest(
    images: Images,
    lights: Mapping[str, FloatArray] | None = None,
    also: Callable[[FloatArray], Iterable[Hypothesis]] = lambda reference: (),
) -> Cause | None:
    """Name the one cause that explains most of the squared difference beyond noise, or None where
    nothing does so clearly.

    lights: the reference's pictures of single lights (height, width, 3), by name;  also: other
    hypotheses about a reference, rendered only if the difference is clear.
    """
    if images.candidate.shape != images.reference.shape:
        return None
    if count_nonfinite(images.candidate, images.reference):
        return None
    misfit = Misfit(images)
    if not (misfit.clear and misfit.excess > 0.0):
        return None
    found = [
        *brightness.hypotheses(misfit, lights or {}),
        *colour.hypotheses(misfit),
        *place.hypotheses(misfit),
        *also(misfit.reference),
    ]
    left = np.array([misfit.left(h.picture) for h in found])
    # Noise may leave less than nothing.
    left -= min(float(left.min()), 0.0)
    ranked = list(zip(found, left.tolist(), strict=True))
    best = _best(ranked, misfit.margin)
    reproduced = best is not None and misfit.reproduces(best[0].picture)
    at_border = rim(misfit)
    # A wrong rim changes no other pixel: what explains more of the difference is not of the rim,
    # nor is what predicts as much of it as must lie in a rim.
    enough = at_border is not None and 1.0 - left.min() >= at_border.explained
    enough = enough or (reproduced and best is not None and best[1] <= 1.0 - SHARE)
    if at_border is not None and not enough:
        return at_border
    if best is not None:
        hypothesis, unexplained = best
        if not reproduced:
            return None
        explained = 1.0 - unexplained
        evidence = (
            f"{hypothesis.evidence}: that explains {100.0 * explained:.4g} % of the difference"
        )
        return Cause(hypothesis.name, evidence, explained)
    if left.min() < 1.0 - MOST:
        return None  # several hypotheses explain it, none clearly better than the others
    return one_place(misfit)


def _best(found: list[tuple[Hypothesis, float]], margin: float) -> tuple[Hypothesis, float] | None:
    """The winner and what it leaves unexplained, if it wins clearly, by `margin` at least."""
    by_family: dict[str, tuple[Hypothesis, float]] = {}
    for hypothesis, left in found:
        known = by_family.get(hypothesis.family)
        if known is None or left < known[1]:
            by_family[hypothesis.family] = hypothesis, left
    ranked = sorted(by_family.values(), key=lambda one: (one[0].parameters, one[1]))
    winner = ranked[0]
    for other in ranked[1:]:
        fewer = winner[0].parameters < other[0].parameters
        less = other[1] < (PENALTY if fewer else 1.0) * winner[1]
        if less and winner[1] - other[1] > max(NO_MATTER, margin if fewer else 0.0):
            winner = other
    if winner[1] > 1.0 - MOST:
        return None
    # One with more parameters is no rival: it would have won, did it leave clearly less.
    rivals = [
        left
        for hypothesis, left in by_family.values()
        if hypothesis.family not in {winner[0].family, *GENERALISED.get(winner[0].family, ())}
        and hypothesis.parameters <= winner[0].parameters
    ]
    next_one = min(rivals, default=1.0)
    clear = max(winner[1], NO_MATTER) <= CLEARER * next_one and next_one - winner[1] > margin
    return winner if clear else None
