"""The result of one sweep point, stored in a file of its own, so that it is not measured again; and
points added up: how far each contestant holds, and whether ours holds its range."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, Outcome
from comparisons.experiments.stability.harness.series import Family, Series, family
from comparisons.runs.engine import stored


@dataclass(frozen=True)
class Found:
    """outcomes: by contestant;  seconds: that it took, compiling included;  broken: why there are
    no outcomes, "" where there are."""

    family: str
    series: str
    x: float
    outcomes: dict[str, Outcome]
    seconds: float
    broken: str = ""

    @property
    def ours(self) -> Outcome | None:
        return self.outcomes.get(OURS)

    @classmethod
    def read(cls, path: Path, key: str) -> "Found | None":
        """The stored result, None where there is none of this key."""
        try:
            document: dict[str, Any] = stored(path, key)
            outcomes = {
                name: Outcome(**(some | {"examples": tuple(some["examples"])}))
                for name, some in document.pop("outcomes").items()
            }
            return cls(outcomes=outcomes, **document)
        except (ValueError, KeyError, TypeError, AttributeError):
            return None


FURTHER = 1e4
"""Times that ours should hold further than float32: what 29 bits more allow."""


def found_of(found: Iterable[Found], family: str, series: str | None = None) -> list[Found]:
    return [f for f in found if f.family == family and series in (None, f.series)]


def contestants(found: Sequence[Found]) -> list[str]:
    """Ours first, then Mitsuba, then the others in the order of their appearance."""
    names = dict.fromkeys(name for f in found for name in f.outcomes)
    return sorted(names, key=lambda name: (name != OURS, name != MITSUBA))


def named(contestant: str) -> str:
    """The name that tables and charts show."""
    return "Mitsuba" if contestant == MITSUBA else contestant.replace("_", " ")


def first_failure(found: Iterable[Found], contestant: str) -> float | None:
    """The smallest x at which a case of this series failed; None where none did."""
    failing = [
        f.x for f in found if contestant in f.outcomes and f.outcomes[contestant].failures > 0
    ]
    return min(failing, default=None)


def total(found: Iterable[Found], contestant: str) -> Outcome | None:
    """All points together; None where the contestant did not take part."""
    some = [f.outcomes[contestant] for f in found if contestant in f.outcomes]
    return sum(some[1:], some[0]) if some else None


@dataclass(frozen=True)
class SeriesSummary:
    """ours, mitsuba: where each starts to fail, None where it does not, up to `last`, or does not
    take part;  last: the largest x;  broken: why points were not measured;  failed: x within the
    guaranteed range at which ours failed."""

    series: Series
    found: tuple[Found, ...]
    ours: float | None
    mitsuba: float | None
    mitsuba_took_part: bool
    last: float
    broken: tuple[str, ...]
    failed: tuple[float, ...]

    @property
    def holds(self) -> bool:
        return not self.broken and not self.failed

    @property
    def further(self) -> float | None:
        """How many times further ours holds, at least; None where Mitsuba does not fail."""
        if self.mitsuba is None:
            return None
        return (self.ours if self.ours is not None else self.last) / self.mitsuba

    @property
    def unexplained(self) -> bool:
        """Whether ours should hold further than it does, and nothing says why it does not."""
        if not self.series.axis or self.further is None or self.series.explained:
            return False
        return self.further < FURTHER


def summarise(family: Family, found: Sequence[Found]) -> list[SeriesSummary]:
    """The series of a family that were measured."""
    summaries = []
    for series in family.series:
        some = found_of(found, family.id, series.name)
        if not some:
            continue
        failed = [f.x for f in some if f.x <= series.holds_to and f.ours and f.ours.failures]
        summaries.append(
            SeriesSummary(
                series,
                tuple(some),
                first_failure(some, OURS),
                first_failure(some, MITSUBA),
                any(MITSUBA in f.outcomes for f in some),
                max(f.x for f in some),
                tuple(f"{series.name} at {f.x:g}: {f.broken}" for f in some if f.broken),
                tuple(failed),
            )
        )
    return summaries


def summaries(found: Sequence[Found]) -> dict[str, list[SeriesSummary]]:
    """By the ids of families."""
    names = dict.fromkeys(f.family for f in found)
    return {name: summarise(family(name), found_of(found, name)) for name in names}
