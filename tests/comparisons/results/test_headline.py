"""The headline: one plain sentence, the cause first, whatever the case."""

import typing

import pytest

from comparisons.results.case import Case, Cause, RungResult, Status
from comparisons.results.headline import headline, in_short
from comparisons.results.rungs import RUNGS

STATUSES = typing.get_args(Status)
CAUSE = Cause("half-pixel shift in x", "by 0.5, 0 pixels", 0.99)


def case(verdict, *rungs, cause=None, reason="input: why; and more", sides=("ours", "Mitsuba's")):
    return Case("a", verdict, reason, rungs, None, {}, cause=cause, sides=sides)


def statistics(status="differ", biases=(0.01, 0.011, 0.012), image=True, tiles=0, pixels=0, **more):
    numbers = {
        "relative_bias": dict(zip("RGB", biases, strict=True)),
        "detectable_bias": {"R": 0.002, "G": 0.0035, "B": 0.001},
        "limit": 0.005,
        "image": {"differs": image},
        "tiles": {"differ": tiles, "tested": 64, "worst_bias": -0.12},
        "pixels": {"differ": pixels, "tested": 16384, "worst_bias": 2.0},
    }
    return RungResult("statistics", status, "numbers; more numbers", numbers | more)


@pytest.mark.parametrize(
    ("rung", "sides", "what"),
    [
        (statistics(), ("ours", "Mitsuba's"), "our picture is 1.1 % brighter than Mitsuba's"),
        (
            statistics(biases=(-0.02, -0.02, -0.02)),
            ("candidate's", "the baseline's, x"),
            "the candidate's picture is 2.0 % darker than the baseline's, x",
        ),
        (
            statistics(biases=(0.02, -0.001, 0.0)),
            ("ours", "Mitsuba's"),
            "our picture is of another brightness than Mitsuba's: R +2.0 %, G -0.10 %, B +0 %",
        ),
        (statistics(biases=(None,) * 3), ("o", "m"), "the picture is not black, as m is"),
        (statistics(image=False, tiles=3), ("o", "m"), "3 of 64 tiles differ, the worst by -12 %"),
        (
            statistics(image=False, pixels=1200),
            ("o", "m"),
            "1,200 of 16,384 pixels differ, the worst by +200 %",
        ),
        (
            statistics(biases=(float("inf"), float("inf"), 0.01)),
            ("ours", "m"),
            "our picture is of another brightness than m: R an unbounded amount, G an unbounded "
            "amount, B +1.0 %",
        ),
        (statistics(image=False), ("o", "m"), "numbers"),
        (RungResult("statistics", "differ", "of others; x"), ("o", "m"), "of others"),
        (RungResult("geometry", "differ", "9 of 10 rays; x"), ("o", "m"), "9 of 10 rays"),
    ],
)
def test_what_differs_after_its_cause(rung, sides, what):
    told = headline(case("differ", rung, cause=CAUSE, sides=sides))
    assert told == f"likeliest cause: half-pixel shift in x; {what}"
    told = headline(case("differ", rung, sides=sides))
    assert told == f"{what}; no single cause explains it"


@pytest.mark.parametrize(
    ("found", "told"),
    [
        (
            case("agree", RungResult("geometry", "agree", "x"), statistics("agree")),
            "no difference was found, and a bias of the image mean of 0.35 % would have been seen",
        ),
        (case("agree", RungResult("whitted", "agree", "x")), "no difference was found"),
        (
            case("inconclusive", statistics("inconclusive", limit=0.001)),
            "too noisy to decide: only a bias of the image mean above 0.35 % would be seen, and "
            "0.10 % is asked for",
        ),
        (
            case("inconclusive", statistics("inconclusive", limit=0.001, noise_known=False)),
            "a single picture does not show its noise here: give more, with other seeds",
        ),
        (
            case("inconclusive", statistics("inconclusive")),
            "too near to the limit of 0.50 % to decide with so few samples",
        ),
        (
            case(
                "inconclusive", statistics("inconclusive", unseen_light={"missing_at_most": 0.02})
            ),
            "too few samples met the rare light: 2.0 % of all light may be missing by chance, and "
            "0.50 % is asked for",
        ),
        (
            case(
                "inconclusive", statistics("inconclusive", unseen_light={"missing_at_most": 0.001})
            ),
            "too near to the limit of 0.50 % to decide with so few samples",
        ),
        (
            case("invalid", RungResult("input", "invalid", "1 pixel not finite; expected none")),
            "nothing can be said: 1 pixel not finite",
        ),
        (
            case("invalid", RungResult("input", "invalid", "noise is shared; x"), statistics()),
            "the pictures are invalid (noise is shared), and our picture is 1.1 % brighter than "
            "Mitsuba's",
        ),
        (case("invalid"), "nothing can be said: why"),
        (
            case("unchanged", RungResult("images", "unchanged", "x")),
            "nothing has changed: the pictures are the reference's, bit for bit",
        ),
        (case("not-comparable"), "no comparison: why"),
    ],
)
def test_other_verdicts(found, told):
    assert headline(found) == told


@pytest.mark.parametrize("verdict", STATUSES)
@pytest.mark.parametrize("rung", [None, *RUNGS])
def test_every_case_has_a_sentence(verdict, rung):
    """Also one whose rungs say nothing, in one line without an end."""
    rungs = [] if rung is None else [RungResult(rung, verdict, "why; and more")]
    for cause in (None, CAUSE):
        told = headline(case(verdict, *rungs, cause=cause))
        assert told
        assert told[-1] not in ".;: "
        assert "\n" not in told
        assert "more" not in told


@pytest.mark.parametrize("other", RUNGS)
@pytest.mark.parametrize("verdict", STATUSES)
def test_every_rung_may_differ_besides(verdict, other):
    first = RungResult("input", verdict, "why; and more")
    told = headline(case(verdict, first, RungResult(other, "differ", "9 of 10 rays; and more")))
    assert told
    assert "more" not in told


def test_the_bias_that_would_have_been_seen_is_apart():
    agreed = case("agree", statistics("agree"), reason="input, statistics: numbers")
    assert in_short(agreed) == ("no difference was found", "0.35 %")
    assert in_short(case("agree", RungResult("images", "agree", "why"))) == (
        *("no difference was found", ""),
    )


@pytest.mark.parametrize(
    ("numbers", "proof"),
    [
        (
            {
                "resolution": {"hits": 3699, "found": 483},
                "is_limited": True,
                "decided_mitsuba": 267,
            },
            "from 483 of 3,699 points of surfaces, the rays that it starts hit a wrong surface",
        ),
        (
            {"decided_mitsuba": 267, "decided_ours": 0},
            "exact arithmetic finds 267 of its hits wrong, and none of ours",
        ),
        ({"decided_mitsuba": 267, "decided_ours": 1}, ""),
        ({"resolution": {"hits": 2944, "found": 6}, "is_limited": False}, ""),
    ],
)
def test_which_side_is_wrong_and_what_proves_it(numbers, proof):
    geometry = RungResult("geometry", "reference-limited", "why", numbers)
    told = headline(case("reference-limited", geometry))
    assert told.startswith("the pictures agree, and where rays differ Mitsuba's float32 is too")
    assert told.endswith(proof)
    told = headline(case("reference-limited", geometry, RungResult("images", geometry.status, "x")))
    assert told.startswith("the pictures differ, and Mitsuba's is the wrong one: its float32")
    assert told.endswith(proof)
