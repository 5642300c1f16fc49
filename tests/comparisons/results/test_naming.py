"""Sentences about a case have the names of its sides."""

import pytest

from comparisons.results.naming import named

OURS = ("ours", "Mitsuba's")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "the candidate is the reference shifted +0.5, +0 pixels",
            "our picture is Mitsuba's picture shifted +0.5, +0 pixels",
        ),
        (
            "the candidate's direct light is 2 times the reference's at every hit",
            "our direct light is 2 times Mitsuba's at every hit",
        ),
        ("G is 1.2 times the reference's; others agree", "G is 1.2 times Mitsuba's; others agree"),
        ("replicates 1 and 2 of the candidate", "replicates 1 and 2 of our picture"),
        ("brighter than the candidate's", "brighter than ours"),
        ("theCandidate, the candidates, another reference", None),
    ],
)
def test_our_names(text, expected):
    assert named(text, OURS) == (expected or text)


def test_names_of_a_gate():
    text = "the candidate is twice the reference, and the reference's mean is 1"
    expected = "the candidate is twice the baseline's picture, and the baseline's mean is 1"
    assert named(text, ("candidate's", "the baseline's")) == expected
    assert named(text, ("candidate's", "the baseline's, room")) == text
    assert named(text, ("candidate's", "reference's")) == text
    assert named(text, ("the candidate's", "the reference's")) == text
