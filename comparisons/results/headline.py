"""The verdict of a case in one plain sentence, the likeliest cause first; the numbers are in the
reasons of the rungs."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from comparisons.results.case import Case, RungResult, Status
from comparisons.results.rungs import OF_LIGHT

UP_TO = "up to "
"""How the reason of a case begins that is judged up to something, which a colon ends."""


def headline(case: Case) -> str:
    """One sentence without a full stop, such as "likeliest cause: half-pixel shift in x; 25 of 64
    tiles differ, the worst by +12 %"."""
    return _with_disagreement(_SENTENCES[case.verdict](case), case)


def first_difference(case: Case) -> str:
    """The first rung that differs, and what it found; of a case without one, why it is as it is."""
    rung = _first(case, "differ")
    if rung is not None:
        return f"{rung.name}: {_what(rung, case)}"
    if case.verdict in ("agree", "unchanged"):
        return ""
    return headline(case)


def _differ(case: Case) -> str:
    rung = _first(case, "differ")
    what = "the pictures differ" if rung is None else _what(rung, case)
    alone = _of_witness(case, "alone")
    if alone and not what.endswith(said := f"{alone} stands alone"):
        what = f"{what}; {said}"
    if case.cause is None:
        return f"{what}; no single cause explains it"
    return f"likeliest cause: {case.cause.name}; {what}"


def in_short(case: Case) -> tuple[str, str]:
    """The headline, and apart from it the smallest bias of the image mean that would have been
    seen; "" if it is unknown."""
    seen = detectable(next((rung for rung in case.rungs if rung.name == "statistics"), None))
    sentence = _with_disagreement(_none(case), case) if case.verdict == "agree" else headline(case)
    return sentence, "" if seen is None else percent(seen)


def _of_witness(case: Case, name: str) -> str:
    """What the rung `witness` says under a name; "" if nothing."""
    rungs = (rung for rung in case.rungs if rung.name == "witness")
    return next((str(rung.numbers[name]) for rung in rungs if name in rung.numbers), "")


def _with_disagreement(sentence: str, case: Case) -> str:
    """A sentence that says, too, if witnesses disagree."""
    said = _of_witness(case, "disagree")
    return sentence if said in sentence else f"{sentence}; {said}"


def _none(case: Case) -> str:
    up_to = case.reason.partition(":")[0] if case.reason.startswith(UP_TO) else ""
    return f"no difference was found {up_to}".strip()


def _agree(case: Case) -> str:
    none, (_, seen) = _none(case), in_short(case)
    if not seen:
        return none
    return f"{none}, and a bias of the image mean of {seen} would have been seen"


def _unchanged(case: Case) -> str:
    return "nothing has changed: the pictures are the reference's, bit for bit"


def _inconclusive(case: Case) -> str:
    rung = _first(case, "inconclusive")
    seen = detectable(rung)
    limit = None if rung is None else rung.numbers.get("limit")
    if rung is None or seen is None or not isinstance(limit, int | float):
        return "too noisy to decide" if rung is None else f"undecided: {_clause(rung.reason)}"
    if not rung.numbers.get("noise_known", True):
        return "a single picture does not show its noise here: give more, with other seeds"
    advice = rung.numbers.get("advice")
    more = f"; {advice}" if advice else ""
    if seen > limit:
        return (
            f"too noisy to decide: only a bias of the image mean above {percent(seen)} would be "
            f"seen, and {percent(limit)} is asked for{more}"
        )
    unseen = rung.numbers.get("unseen_light")
    missing = unseen.get("missing_at_most") if isinstance(unseen, Mapping) else None
    if isinstance(missing, int | float) and missing > limit:
        return (
            f"too few samples met the rare light: {percent(missing)} of all light may be missing "
            f"by chance, and {percent(limit)} is asked for{more}"
        )
    return f"too near to the limit of {percent(limit)} to decide with so few samples{more}"


def _invalid(case: Case) -> str:
    rung = _first(case, "invalid")
    text = case.reason.partition(": ")[2] if rung is None else rung.reason
    other = _first(case, "differ")
    if other is None:
        return f"nothing can be said: {_clause(text)}"
    return f"the pictures are invalid ({_clause(text)}), and {_what(other, case)}"


def _by_reason(case: Case) -> str:
    return f"no comparison: {_clause(case.reason.partition(': ')[2] or case.reason)}"


def _limited(case: Case) -> str:
    """Which side is wrong, what of it the pictures show, and what proves it."""
    rungs = {rung.name: rung for rung in case.rungs}
    shows = any(name in rungs and rungs[name].status == "reference-limited" for name in OF_LIGHT)
    flip = f" (FLIP {case.metrics.flip:.2g})" if case.metrics and shows else ""
    what = "the pictures agree, and where rays differ Mitsuba's float32"
    if shows:
        what = f"the pictures differ{flip}, and Mitsuba's is the wrong one: its float32"
    numbers = rungs["geometry"].numbers if "geometry" in rungs else {}
    resolution, wrong = numbers.get("resolution"), numbers.get("decided_mitsuba")
    proof = ""
    if isinstance(resolution, Mapping) and numbers.get("is_limited"):
        proof = (
            f": from {resolution['found']:,} of {resolution['hits']:,} points of surfaces, the "
            "rays that it starts hit a wrong surface"
        )
    elif wrong and not numbers.get("decided_ours"):
        proof = f": exact arithmetic finds {wrong:,} of its hits wrong, and none of ours"
    return f"{what} is too coarse for this scene{proof}"


_SENTENCES: Mapping[Status, Callable[[Case], str]] = {
    "agree": _agree,
    "unchanged": _unchanged,
    "differ": _differ,
    "reference-limited": _limited,
    "inconclusive": _inconclusive,
    "not-comparable": _by_reason,
    "not-applicable": _by_reason,
    "invalid": _invalid,
}


# ---- what differs, by rung ----------------------------------------------------------------------


def _of_statistics(rung: RungResult, case: Case) -> str:
    image, tiles, pixels = (
        part if isinstance(part := rung.numbers.get(name), Mapping) else {}
        for name in ("image", "tiles", "pixels")
    )
    biases = rung.numbers.get("relative_bias")
    if image.get("differs") and isinstance(biases, Mapping):
        return _brighter(biases, case)
    for cells, what in ((tiles, "tiles"), (pixels, "pixels")):
        if cells.get("differ"):
            worst = cells.get("worst_bias")
            by = "" if worst is None else f", the worst by {percent(worst, sign=True)}"
            return f"{cells['differ']:,} of {cells['tested']:,} {what} differ{by}"
    return _clause(rung.reason)


def _brighter(biases: Mapping[str, Any], case: Case) -> str:
    known = {name: bias for name, bias in biases.items() if bias is not None}
    if not known:
        return f"the picture is not black, as {case.sides[1]} is"
    values = list(known.values())
    low, high = min(values), max(values)
    owners = {"ours": "our", "candidate's": "the candidate's"}
    picture = f"{owners.get(case.sides[0], case.sides[0])} picture is"
    if low * high > 0.0 and max(abs(low), abs(high)) < 2.0 * min(abs(low), abs(high)):
        mean = sum(values) / len(values)
        how = "brighter" if mean > 0.0 else "darker"
        return f"{picture} {percent(abs(mean))} {how} than {case.sides[1]}"
    each = ", ".join(f"{name} {percent(bias, sign=True)}" for name, bias in known.items())
    return f"{picture} of another brightness than {case.sides[1]}: {each}"


def _what(rung: RungResult, case: Case) -> str:
    """What a rung has found to differ."""
    return _of_statistics(rung, case) if rung.name == "statistics" else _clause(rung.reason)


# ---- words --------------------------------------------------------------------------------------


def _first(case: Case, status: Status, name: str = "") -> RungResult | None:
    """The first rung with this status, and this name if one is given."""
    rungs = (r for r in case.rungs if r.status == status and name in ("", r.name))
    return next(rungs, None)


def detectable(rung: RungResult | None) -> float | None:
    """The smallest bias of the image mean that would have been seen; None if it is unknown."""
    biases = {} if rung is None else rung.numbers.get("detectable_bias")
    if not isinstance(biases, Mapping) or not biases or None in biases.values():
        return None
    return float(max(biases.values()))


def _clause(reason: str) -> str:
    """The first part of a reason."""
    return reason.partition("; ")[0]


def percent(fraction: float, *, sign: bool = False) -> str:
    """To two digits, such as "0.31 %", "12 %" or "+140 %"."""
    number = 100.0 * fraction
    if not math.isfinite(number):
        return "an unbounded amount"
    digits = max(0, 1 - math.floor(math.log10(abs(number)))) if number else 0
    return f"{number:{'+' if sign else ''}.{digits}f} %"
