"""Which rung decides the verdict, and a run's exit code."""

import pytest

from comparisons.results.case import Case, Metrics, RungResult, decide, exit_code

METRICS = Metrics(1.0, 0.0, 60.0, 0.0, 0.0, (0.0, 0.0, 0.0), 0)


def rungs(**statuses):
    return [RungResult(name, status, f"{name} says {status}") for name, status in statuses.items()]


@pytest.mark.parametrize(
    ("statuses", "verdict", "rung"),
    [
        ({"statistics": "differ", "geometry": "differ", "direct": "agree"}, "differ", "geometry"),
        ({"geometry": "agree", "direct": "differ", "whitted": "differ"}, "differ", "direct"),
        ({"geometry": "inconclusive", "statistics": "differ"}, "differ", "statistics"),
        ({"geometry": "reference-limited", "statistics": "differ"}, "differ", "statistics"),
        ({"geometry": "not-comparable", "direct": "inconclusive"}, "inconclusive", "direct"),
        ({"geometry": "agree", "direct": "not-comparable"}, "not-comparable", "direct"),
        ({"geometry": "reference-limited", "direct": "inconclusive"}, "inconclusive", "direct"),
        ({"geometry": "reference-limited", "direct": "agree"}, "reference-limited", "geometry"),
    ],
)
def test_gravest_status_then_first_rung(statuses, verdict, rung):
    assert decide(rungs(**statuses), METRICS) == (verdict, f"{rung}: {rung} says {verdict}")


def test_what_is_invalid_hides_no_difference():
    told = "statistics: statistics says invalid; besides, geometry: geometry says differ"
    found = decide(rungs(geometry="differ", statistics="invalid", images="inconclusive"), METRICS)
    assert found == ("invalid", told)


def test_unchanged_is_no_agreement_and_no_failure():
    found = rungs(statistics="not-applicable", images="unchanged")
    assert decide(found, METRICS) == ("unchanged", "images: images says unchanged")
    assert decide(rungs(input="invalid", images="unchanged"), METRICS)[0] == "invalid"


def test_agreement_needs_a_rung_that_agreed():
    ladder = rungs(geometry="agree", whitted="not-applicable", statistics="agree")
    assert decide(ladder, None) == ("agree", "geometry, statistics: statistics says agree")
    assert decide(rungs(geometry="not-applicable"), METRICS)[0] == "not-comparable"
    assert decide([], METRICS)[0] == "not-comparable"


def test_pixels_not_finite_go_before_everything():
    nan = float("nan")
    metrics = Metrics(nan, nan, nan, nan, nan, (nan, nan, nan), 3)
    verdict, reason = decide(rungs(geometry="differ", statistics="agree"), metrics)
    assert (verdict, reason) == ("invalid", "images: 3 pixels not finite")
    assert decide(rungs(direct="invalid"), metrics)[1] == "direct: direct says invalid"


def test_a_rung_of_unknown_name_is_refused():
    with pytest.raises(ValueError, match="sheen"):
        decide([RungResult("sheen", "differ", "")], METRICS)


def case(verdict, **statuses):
    return Case("scene", verdict, "", tuple(rungs(**statuses)), METRICS, {})


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [
        (["agree", "reference-limited"], 0),
        (["agree", "differ"], 1),
        (["agree", "inconclusive"], 1),
        (["agree", "not-comparable"], 1),
        (["agree", "invalid"], 1),
        ([], 4),
    ],
)
def test_exit_code(verdicts, code):
    assert exit_code([case(verdict, geometry="agree") for verdict in verdicts]) == code


def test_exit_code_of_a_case_that_could_not_run():
    ran = [case("agree", direct="agree"), case("differ", direct="differ")]
    assert exit_code(ran) == 1
    assert exit_code([*ran, case("invalid", run="invalid")]) == 4
