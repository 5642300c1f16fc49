"""Several witnesses: none makes a verdict better, and that they disagree is said."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke

import reference_rt as rt
from comparisons.commands.compare import _command
from comparisons.compare.budget import Budget, usual
from comparisons.compare.compare import Subject, compare_scene
from comparisons.cycles.backend import PYTHON
from comparisons.results.case import Case, RungResult, decide
from comparisons.results.headline import headline, in_short
from comparisons.rungs import witness as witnesses
from comparisons.rungs.witness import together, vote
from comparisons.suites.suite import Changes

SIDES = ("ours", "Mitsuba's")

GRAVITY = ["agree", "not-comparable", "differ"]
"""Of verdicts, from the best."""


def pictures(seed, factor=1.0):
    rng = np.random.default_rng(seed)
    return factor * rng.normal(1.0, 0.05, (8, 16, 16, 3))


def heard(ours, mitsubas, witness, whose):
    """What a witness says by pictures of these factors."""
    seeds = (11, 12, sum(map(ord, whose)))
    some = (pictures(seed, f) for seed, f in zip(seeds, (ours, mitsubas, witness), strict=True))
    rung = vote(tuple(some), (*SIDES, whose), 0.05)
    rung.numbers["whose"] = whose
    return rung


HITS = {
    "right": RungResult("witness", "agree", "9 first hits are B's", {"first hits": {}}),
    "wrong": RungResult("witness", "differ", "9 first hits are wrong", {"first hits": {}}),
}
NO_VOTE = RungResult("witness", "not-applicable", "the integrator path: it does not vote", {})
NOT_THERE = RungResult("witness", "not-comparable", "it has died", {})


@pytest.mark.parametrize(
    ("factors", "status", "alone", "disagree"),
    [
        ((1.0, 1.0, 1.0, 1.0), "agree", None, None),
        ((1.1, 1.0, 1.0, 1.0), "differ", "ours", None),
        ((1.0, 1.1, 1.0, 1.0), "agree", "Mitsuba's", None),
        (
            *((1.1, 1.0, 1.0, 1.1), "differ", None),
            "A says that ours stands alone, B says that Mitsuba's stands alone",
        ),
        (
            *((1.0, 1.0, 1.0, 1.1), "differ", None),
            "A says that both sides are right, B says that both sides are wrong, or it is itself",
        ),
    ],
)
def test_two_of_pictures(factors, status, alone, disagree):
    ours, mitsubas, *theirs = factors
    votes = {w: heard(ours, mitsubas, f, f"{w}'s") for w, f in zip("AB", theirs, strict=True)}
    rung = together(votes)
    assert rung.status == status
    assert rung.numbers.get("alone") == alone
    said = rung.numbers.get("disagree")
    assert said == (disagree and f"the witnesses disagree: {disagree}")
    for title, one in votes.items():
        assert f"{title}: {one.reason}" in rung.reason
        assert rung.numbers["witnesses"][title] == one.numbers


@pytest.mark.parametrize(
    ("of_pictures", "of_hits", "disagree"),
    [
        ((1.0, 1.0, 1.0), "right", False),
        ((1.1, 1.0, 1.0), "right", False),  # the light is wrong, not the hits
        ((1.1, 1.0, 1.0), "wrong", False),
        ((1.0, 1.0, 1.0), "wrong", True),
    ],
)
def test_right_first_hits_are_no_answer_to_a_wrong_picture(of_pictures, of_hits, disagree):
    rung = together({"A": heard(*of_pictures, "A's"), "B": HITS[of_hits]})
    assert ("disagree" in rung.numbers) == disagree


def test_a_second_witness_makes_no_verdict_better():
    """Whatever both say, and whatever the statistics are."""
    factors = [1.0, 1.1]
    every = [heard(*some, "A's") for some in itertools.product(factors, repeat=3)]
    every += [*HITS.values(), NO_VOTE, NOT_THERE]
    assert {rung.status for rung in every} == {*GRAVITY, "not-applicable"}
    for statistics in ("agree", "differ"):
        base = RungResult("statistics", statistics, "...")
        for one, two in itertools.product(every, repeat=2):
            both, *alone = (
                GRAVITY.index(decide([base, rung], None)[0])
                for rung in (together({"A": one, "B": two}), one, two)
            )
            assert both == max(alone)


def test_one_witness_is_as_it_was():
    rung = heard(1.1, 1.0, 1.0, "A's")
    assert together({"A": rung}) is rung


@pytest.fixture
def two(monkeypatch):
    """two(factors, said) -> witnesses whose pictures are the mean of both sides, times these, and
    what else their rungs have."""

    def make(factors, **said):
        def witness_of(name, scene, limit, threads, say, seen):
            def hear(replicates, sides):
                whose, third = f"{name}'s", factors[name] * sum(replicates) / 2.0
                rung = vote((*replicates, third), (*sides, whose), limit)
                rung.numbers.update({"whose": whose} | said.get(name, {}))
                return rung, {whose: third.mean(axis=0)}

            return hear

        monkeypatch.setattr(witnesses, "witness_of", witness_of)

    return make


def compared(witness=("cycles", "povray")) -> Case:
    scene = rt.Scene(
        film=rt.Film(width=24, height=16),
        integrator=rt.Path(max_depth=2),
        materials={"grey": rt.Diffuse(reflectance=0.5)},
        shapes=(rt.Sphere(center=(0, 0, -4), material="grey"),),
        lights=(rt.Constant(radiance=1.0),),
    )
    budget = Budget(spp=16, limit=0.05, pixels=64, witness=witness)
    only = ("statistics", "images")
    return compare_scene(Subject(scene), budget, lambda line: None, 1, only)


def test_a_comparison_hears_both_and_shows_both(two):
    two({"cycles": 1.0, "povray": 1.0})
    case = compared()
    assert case.verdict == "agree"
    assert list(case.images.others) == ["cycles's", "povray's"]
    assert "disagree" not in case.reason


def test_a_verdict_says_that_they_disagree(two):
    two({"cycles": 1.0, "povray": 1.3})
    case = compared()
    assert case.verdict == "differ"
    assert case.reason.count("the witnesses disagree") == 1
    assert headline(case).count("the witnesses disagree") == 1


def test_who_stands_alone_is_said_once(two):
    two({"cycles": 1.3})
    case = compared("cycles")
    assert case.verdict == "differ"
    assert headline(case).count("cycles's stands alone") == 1


def test_an_agreement_says_so_too(two):
    two({"cycles": 1.0, "povray": 1.0}, povray={"alone": "Mitsuba's"})
    case = compared()
    assert case.verdict == "agree"
    for told in (case.reason, headline(case), in_short(case)[0]):
        assert "the witnesses disagree: Cycles says that both sides are right" in told
        assert told.count("disagree") == 1


@pytest.mark.parametrize(
    ("given", "names"),
    [
        (None, ()),
        ("povray", ("povray",)),
        (["povray", "cycles", "povray"], ("povray", "cycles")),
    ],
)
def test_one_or_several_may_be_given(given, names):
    assert Budget(witness=given).witness == names
    assert usual(witness=given).witness == names


def test_the_command_that_repeats_a_case_names_all():
    again = _command(Path("a.yaml"), Changes(), {"witness": ["povray", "cycles"]})
    assert again == "reference-rt compare a.yaml --fresh --witness povray --witness cycles"


@pytest.mark.parametrize(
    "words",
    [["compare"], ["suite", "smoke", "--only", "cornell_box"], ["selftest", "--mirrored"]],
    ids=lambda words: words[0],
)
def test_others_are_no_witnesses(words, tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("shapes: [{type: sphere}]\n")
    done = invoke(*words, *([path] if len(words) == 1 else []), "--witness", "mitsuba")
    assert done.exit_code == 2, done.output
    assert "witness: expected cycles or povray, got 'mitsuba'" in done.stderr


def test_each_must_be_installed(monkeypatch, tmp_path):
    monkeypatch.delenv(PYTHON, raising=False)
    path = tmp_path / "a.yaml"
    path.write_text("lights: [{type: constant, radiance: 1}]\nshapes: [{type: sphere}]\n")
    asked = ("--witness", "povray", "--witness", "cycles", "--out", tmp_path / "out")
    done = invoke("compare", path, *asked)
    assert done.exit_code == 4
    assert PYTHON in done.stderr
