"""Looks at a growing number of replicates: how they grow, when they end, and their false alarms."""

import itertools

import numpy as np
import pytest
from noise import LAWS, normal
from scipy import stats

from comparisons import statistics
from comparisons.compare.looks import (
    FIRST,
    MOST_KEPT,
    PATIENCE,
    Looks,
    Pool,
    group_of,
    level_of,
    mean_picture,
    most_kept,
    until_decided,
)
from comparisons.results.case import RungResult
from comparisons.statistics import Margins

SIDE = 16


class Time:
    """A clock that only `grow` moves: `each` seconds a replicate."""

    def __init__(self, each):
        self.now, self.each, self.made = 0.0, each, 0
        self.grown = []

    def __call__(self):
        return self.now

    def grow(self, count):
        self.now += self.each * (count - self.made)
        self.made = count
        self.grown.append(count)


def looked(statuses, each=1.0, seconds=1e9, asks=(), **more):
    """The looks that judge so, the last status for ever; and what they were told.

    asks: how many replicates the noise asks for, one time after the other, the last for ever."""
    time, levels, said = Time(each), [], []
    wishes = itertools.chain(asks, itertools.repeat(asks[-1])) if asks else None
    answers = itertools.chain(statuses, itertools.repeat(statuses[-1]))

    def judge(level):
        levels.append(level)
        return RungResult("statistics", next(answers), "because", {"a": 1})

    asked = None if wishes is None else lambda level: next(wishes)
    found = until_decided(
        time.grow, judge, seconds=seconds, say=said.append, clock=time, asked=asked, **more
    )
    assert set(found.counts) <= set(time.grown)
    assert found.counts[-1] == time.grown[-1]
    assert levels == [level_of(k + 1) for k in range(len(levels))]
    return found, said


def test_levels_sum_to_less_than_one():
    levels = [level_of(look) for look in range(1, 40)]
    assert 0.99 < sum(levels) <= 1.0
    assert all(a > b > 0.0 for a, b in itertools.pairwise(levels))
    with pytest.raises(ValueError, match="look 0"):
        level_of(0)


@pytest.mark.parametrize("status", ["agree", "differ", "invalid", "not-applicable"])
@pytest.mark.parametrize("before", [0, 1, 4])
def test_it_ends_when_it_is_decided(status, before):
    found, said = looked(["inconclusive"] * before + [status])
    assert found.counts == tuple(FIRST << k for k in range(before + 1))
    assert found.rung.status == status
    assert found.level == level_of(before + 1)
    assert not found.out_of_time
    assert len(said) == before + 1
    assert said[-1] == f"look {before + 1}, {FIRST << before} replicates: {status}"


@pytest.mark.parametrize(
    ("seconds", "counts"),
    [
        (0.1, (8,)),  # the first look is always taken
        (9.0, (8,)),  # one more is not worth a look
        (12.0, (8, 12)),  # what there is time for
        (16.0, (8, 16)),
        (17.0, (8, 16)),
        (63.5, (8, 16, 32, 63)),
        (1e3, (8, 16, 32, 64, 128, 256, 512, 1000)),
    ],
)
def test_it_ends_at_the_time_limit(seconds, counts):
    found, said = looked(["inconclusive"], seconds=seconds)
    assert found.counts == counts
    assert found.out_of_time
    assert said[-1].endswith(f"the time limit of {seconds:g} s is reached")
    assert "time limit was reached" in found.judged.reason


def test_a_look_ends_with_whole_groups():
    found, _ = looked(["inconclusive"], seconds=1e3, most=64)
    assert found.counts[-1] == 1000  # groups of eight
    found, _ = looked(["inconclusive"], seconds=999.0, most=64)
    assert found.counts[-1] == 992


@pytest.mark.parametrize(
    ("asks", "seconds", "counts"),
    [
        ((3,), 1e9, (8,)),  # the noise permits a decision
        ((10, 10), 1e9, (10,)),
        ((10, 13, 13), 1e9, (13,)),  # after two more they are known better
        ((1000,), 1e9, (24,)),  # a difference is not told too late
        ((1000,), 20.0, (20,)),
        ((1000,), 7.0, (8,)),  # the first look is always taken
    ],
)
def test_the_first_look_waits_for_the_noise(asks, seconds, counts):
    found, _ = looked(["agree"], asks=asks, seconds=seconds, most_first=24)
    assert found.counts == counts
    assert found.level == level_of(1)  # reading the noise is no look


def test_it_does_not_wait_where_the_number_is_given():
    found, _ = looked(["differ"], asks=(1000,))
    assert found.counts == (FIRST,)


@pytest.mark.parametrize(
    ("asks", "then"),
    [(8, 16), (5, 16), (9, 11), (13, 15), (17, 16), (1000, 16)],
)
def test_later_looks_have_what_the_noise_asks_for(asks, then):
    """Twice as many where the noise permits a decision: then the difference is near a limit."""
    found, _ = looked(["inconclusive", "agree"], asks=(asks,))
    assert found.counts == (8, then)


def test_a_first_look_has_whole_groups():
    found, _ = looked(["agree"], asks=(17, 17), most_first=24, most=8)
    assert found.counts == (18,)


def test_what_is_said_of_looks():
    rung = RungResult("statistics", "agree", "it is so", {"a": 1})
    found = Looks((8, 16, 32), 0.125, rung)
    assert found.judged.reason == "it is so; look 3, at 32 replicates (after 8, 16)"
    assert found.judged.numbers == {
        "a": 1,
        "looks": 3,
        "replicates_at_looks": [8, 16, 32],
        "share_of_levels": 0.125,
    }
    assert Looks((8,), 0.5, rung).words == "look 1, at 8 replicates"


@pytest.mark.parametrize("most", [1, 3, 8])
def test_a_pool_keeps_means_of_groups(most):
    rng = np.random.default_rng(1)
    given = rng.random((50, 2, 3, 3))
    pool = Pool(most, mean_picture)
    for count, picture in enumerate(given, 1):
        pool.add(picture)
        assert len(pool) == count
        per = group_of(count, most)
        whole = count // per
        expected = given[: whole * per].reshape(whole, per, 2, 3, 3).mean(axis=1)
        # Means of means: rounding of a few sums.
        assert len(pool.pictures()) == whole
        np.testing.assert_allclose(pool.pictures(), expected, rtol=1e-14)
        assert len(expected) < 2 * most or per == 1


def test_how_many_are_kept():
    assert most_kept(8, 3 * 64 * 64) == MOST_KEPT
    assert most_kept(8, 1 << 26) == 8  # those of the first look, whatever they take
    assert most_kept(200, 12) == 200


def common(rng, count, side):
    """Each picture as a whole is a little brighter or darker than the others, so that the pixels do
    not show the noise."""
    gain = 1.0 + 0.02 * rng.standard_normal((count, 1, 1, 1))
    return gain * (1.0 + 0.05 * rng.standard_normal((count, side, side, 3)))


EVERY = {**LAWS, "common": common}


def sequence(law, seed, limit, gain=1.0, looks=5, stop=True, sized=False):
    """The statuses of looks at two sides of this noise, the candidate's times a gain; without
    `stop` all looks are taken, whatever the former ones said; and the counts if `sized` by the
    noise."""
    rng = np.random.default_rng(seed)
    sides = [], []
    statuses = []

    def grow(count):
        while len(sides[0]) < count:
            sides[0].append(gain * law(rng, 1, SIDE)[0])
            sides[1].append(law(rng, 1, SIDE)[0])

    def judge(level):
        found = statistics.compare(*map(np.stack, sides), limit=limit, level=level)
        statuses.append(found.status)
        on = not stop or found.status == "inconclusive"
        ends = len(statuses) == looks or not on
        return RungResult("statistics", "agree" if ends else "inconclusive", "")

    def asked(level):
        return statistics.replicates_asked(*map(np.stack, sides), limit, level)

    more = {"asked": asked, "most_first": PATIENCE * FIRST} if sized else {}
    found = until_decided(grow, judge, seconds=1e9, **more)
    return (statuses, found.counts) if sized else statuses


def enough(law, replicates):
    """The limit that so many replicates of both sides can tell."""
    rng = np.random.default_rng(99)
    means = law(rng, 96, SIDE).mean(axis=(1, 2))
    error = np.sqrt(2.0 / replicates) * (means.std(axis=0, ddof=1) / means.mean(axis=0)).max()
    return Margins().image + 7.7 * error  # with 22 degrees of freedom


@pytest.mark.cases(2)
@pytest.mark.parametrize("law", EVERY)
def test_no_false_alarm_where_the_noise_sets_the_number(law):
    limit = enough(EVERY[law], 12)
    found = [sequence(EVERY[law], seed, limit, looks=2, sized=True) for seed in range(12)]
    assert sum(alarms(statuses) for statuses, _ in found) == 0
    assert len({counts[0] for _, counts in found}) > 1 or law == "texture"  # never enough


@pytest.mark.slow
@pytest.mark.parametrize("law", EVERY)
def test_false_alarms_where_the_noise_sets_the_number_over_a_thousand_seeds(law):
    """At most one in a thousand, as for a given number: binomial, at 1 %."""
    cases, limit = 1000, enough(EVERY[law], 12)
    found = sum(
        alarms(sequence(EVERY[law], seed, limit, looks=3, sized=True)[0]) for seed in range(cases)
    )
    assert found <= stats.binom.isf(0.01, cases, 1e-3)


@pytest.mark.parametrize("law", ["normal", "filtered", "common"])
def test_what_the_noise_asks_for_is_enough_and_not_too_much(law):
    """Where twelve replicates suffice, a right one agrees at about as many, and a bias of the limit
    is seen: of 40 the chance that two are not is below 1 in 10 if 99 % are."""
    limit, seeds = enough(EVERY[law], 12), range(40)
    right = [sequence(EVERY[law], seed, limit, sized=True) for seed in seeds]
    assert all(statuses[-1] == "agree" for statuses, _ in right)
    assert 10.0 < np.mean([counts[-1] for _, counts in right]) < 18.0
    assert sum(len(statuses) == 1 for statuses, _ in right) >= 36
    wrong = [sequence(EVERY[law], seed, limit, 1.0 + limit, sized=True)[0] for seed in seeds]
    assert sum(statuses[-1] == "differ" for statuses in wrong) >= 39
    assert not any(statuses[-1] == "agree" for statuses in wrong)


def alarms(statuses):
    return any(status in ("differ", "invalid") for status in statuses)


@pytest.mark.cases(1)
@pytest.mark.parametrize("law", LAWS)
def test_no_false_alarm_at_any_look(law):
    """All looks are taken, even after agreement, which is harder than what is done."""
    found = [sequence(LAWS[law], seed, 0.02, looks=3, stop=False) for seed in range(12)]
    assert sum(map(alarms, found)) == 0
    assert all(len(statuses) == 3 for statuses in found)


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_false_alarms_of_all_looks_over_a_thousand_seeds(law):
    """At most one in a thousand, as for a single look: binomial, at 1 %."""
    cases = 1000
    found = sum(
        alarms(sequence(LAWS[law], seed, 1e-2, looks=5, stop=False)) for seed in range(cases)
    )
    assert found <= stats.binom.isf(0.01, cases, 1e-3)


@pytest.mark.slow
def test_what_looks_decide():
    """The right ones agree, the stated bias is caught in 97 % and more; the law is one whose
    standard error falls to what the limit asks for between the second and the third look."""
    limit, cases = 0.02, 200
    ends = {
        gain: [sequence(normal, s, limit, gain)[-1] for s in range(cases)] for gain in (1.0, 1.02)
    }
    assert ends[1.0].count("agree") == cases
    assert ends[1.02].count("differ") >= 0.97 * cases
