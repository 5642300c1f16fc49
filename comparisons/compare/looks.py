"""Looks at a growing number of replicates, until the question is decided: a group-sequential test.

Each look tests all replicates that there are so far. With the full level at every look a right
renderer would have a false alarm at some look several times too often. So the level is spent (Lan
and DeMets 1983): look 1 uses half of each family's level, look 2 a quarter, look 3 an eighth. By
the union bound the chance of a false alarm at any of the looks is below the stated level, however
many looks there are and whatever the law of the noise.

The price is small, because the levels are small: the interval of look 3 is 13 % wider than that of
a single look with as many replicates. The correlation of successive looks could be used to gain a
part of it back, but only if the noise were normal.

The replicates of a look depend on the number of the look, on the noise and on the time that is
left, never on the differences that were seen: otherwise a look could be placed where noise is
largest. Reading the noise is no look (an internal pilot, Wittes and Brittain 1990): of normal noise
the spread tells nothing of the mean. Of skewed noise it does, on both sides alike, and with it the
stopping: what that does to false alarms is measured (`tests/comparisons/compare/test_looks.py`).
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from comparisons.results.case import FloatArray, RungResult

T = TypeVar("T")

FIRST = 8
"""Replicates of a side at the first look: the least that gives the rank test of blocks
(`statistics.ranks`) enough contrasts."""

PARTS = 8
"""Unless it is told otherwise, `compare` divides a scene's samples into so many parts, and each
replicate has one: of small replicates the noise can ask for a few more."""

PATIENCE = 3
"""And its first look waits until the noise permits a decision, up to so many times FIRST: a
difference that is there should not be told too late."""

SECONDS = 600.0
"""Default time limit: replicates are not added beyond it."""

WORTH = 1.25
"""The least growth that is worth a look: it narrows the interval by a tenth, which is about what
the smaller level of a further look costs."""

CUSHION = 1.15
"""How many times the replicates that the noise asks for a later look has: their number is known to
a fifth, and a further look costs more than a few replicates."""

MOST_KEPT = 64
"""Most pictures of a side that are kept; beyond it pairs of replicates are averaged. With 63
degrees of freedom a side, Student's quantiles are within 5 % of the normal ones."""

MOST_NUMBERS = 1 << 27
"""Values of all kept pictures of a side, 1 GiB: of large pictures fewer are kept."""


def level_of(look: int) -> float:
    """The share of each family's level that look 1, 2, 3, ... uses; the sum of all is 1."""
    if look < 1:
        raise ValueError(f"look {look}: expected 1 for the first, and so on")
    return 0.5**look


@dataclass(frozen=True)
class Looks:
    """What was looked at.  counts: the replicates of a side at each look;  level: the share of the
    levels that the last look used;  rung: its result;  out_of_time: it is inconclusive because
    there was no time for more."""

    counts: tuple[int, ...]
    level: float
    rung: RungResult
    out_of_time: bool = False

    @property
    def words(self) -> str:
        """For people, such as "look 3, at 32 replicates (after 8, 16)"."""
        *before, last = self.counts
        text = f"look {len(self.counts)}, at {last} replicates"
        return f"{text} (after {', '.join(map(str, before))})" if before else text

    @property
    def judged(self) -> RungResult:
        """The last look's result, which says how many looks there were."""
        rung = self.rung
        reason = f"{rung.reason}; {self.words}"
        if self.out_of_time:
            reason += "; the time limit was reached, and a longer one adds replicates"
        numbers = rung.numbers | {
            "looks": len(self.counts),
            "replicates_at_looks": list(self.counts),
            "share_of_levels": self.level,
        }
        return RungResult(rung.name, rung.status, reason, numbers)


def until_decided(
    grow: Callable[[int], None],
    judge: Callable[[float], RungResult],
    *,
    seconds: float,
    first: int = FIRST,
    most: int | None = None,
    most_first: int = 0,
    asked: Callable[[float], int] | None = None,
    say: Callable[[str], None] = lambda line: None,
    clock: Callable[[], float] = time.perf_counter,
) -> Looks:
    """Add replicates until a look is not `inconclusive`, or the time limit is reached.

    grow: makes replicates until there are as many of each side;  judge: the result of a look at
    them with this share of the levels;  seconds: no replicates are begun that would probably end
    later;  first: replicates of the first look, which is taken in any case;  most: of the `Pool`
    that keeps them, whose groups a look has as a whole;  asked: how many replicates a decision
    with this share of the levels takes, by the noise of those that there are; None: their number is
    doubled;  most_first: while it asks for more, the first look waits, up to so many;  say: is told
    of each look.
    """
    counts: list[int] = []
    start, count = clock(), first

    def in_time(wish: int, each: float) -> int:
        """Of `wish` replicates those for which there is time, in whole groups."""
        left = seconds - (clock() - start)
        fits = wish if each <= 0.0 else min(wish, count + int(max(left, 0.0) / each))
        return fits - fits % (1 if most is None else group_of(fits, most))

    while True:
        begun, before = clock(), counts[-1] if counts else 0
        grow(count)
        each = (clock() - begun) / (count - before)
        while asked is not None and not counts and count < most_first:
            fits = in_time(min(_whole(asked(level_of(1)), most), most_first), each)
            if fits <= count:
                break
            grow(fits)
            count = fits
        counts.append(count)
        look = len(counts)
        rung = judge(level_of(look))
        told = f"look {look}, {count} replicates: {rung.status}"
        if rung.status != "inconclusive":
            say(told)
            return Looks(tuple(counts), level_of(look), rung)
        wish = 2 * count if asked is None else _next(count, asked(level_of(look + 1)))
        fits = in_time(_whole(wish, most), each)
        if fits < WORTH * count:
            say(f"{told}; the time limit of {seconds:g} s is reached")
            return Looks(tuple(counts), level_of(look), rung, out_of_time=True)
        say(f"{told}; goes on to {fits}, about {each * (fits - count):.0f} s")
        count = fits


def _next(count: int, asked: int) -> int:
    """The replicates of the look after one at `count` that did not decide: twice as many at most,
    since the more there are, the less rare light seems.  If their noise permits a decision, the
    difference is near a limit: then there are twice as many, too."""
    if asked <= count:
        return 2 * count
    return min(math.ceil(max(CUSHION * asked, WORTH * count)), 2 * count)


def _whole(count: int, most: int | None) -> int:
    """As many replicates, or a few more, that make whole groups of a `Pool`."""
    return count if most is None else count + -count % group_of(count, most)


def mean_picture(pictures: list[FloatArray]) -> FloatArray:
    """The mean of some pictures of one shape."""
    return np.asarray(np.mean(pictures, axis=0))


class Pool(Generic[T]):
    """The replicates of one side. At most twice `most` pictures are kept: then pairs of them are
    averaged, by `mean`, so that each is the mean of so many replicates."""

    def __init__(self, most: int, mean: Callable[[list[T]], T]) -> None:
        self._most, self._mean, self._per = most, mean, 1
        self._kept: list[T] = []
        self._open: list[T] = []

    def add(self, picture: T) -> None:
        """Add a replicate."""
        self._open.append(picture)
        if len(self._open) < self._per:
            return
        self._kept.append(self._mean(self._open) if self._per > 1 else picture)
        self._open.clear()
        if len(self._kept) == 2 * self._most:
            self._kept = [self._mean(self._kept[k : k + 2]) for k in range(0, 2 * self._most, 2)]
            self._per *= 2

    def __len__(self) -> int:
        """The replicates that were added."""
        return self._per * len(self._kept) + len(self._open)

    def pictures(self) -> list[T]:
        """The pictures that are kept; of a group that is not whole nothing."""
        return list(self._kept)


def most_kept(first: int, numbers: int) -> int:
    """How many pictures of so many values a `Pool` keeps at least: those of the first look."""
    return max(first, min(MOST_KEPT, MOST_NUMBERS // numbers))


def group_of(count: int, most: int) -> int:
    """Of how many replicates a picture in a `Pool` is the mean, after so many were added."""
    per = 1
    while count >= 2 * most * per:
        per *= 2
    return per
