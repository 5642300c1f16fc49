"""The table of all series: for a terminal, and as Markdown."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import RenderableType

from comparisons.experiments.stability.harness.core import MITSUBA, OURS, Effort, Found, Outcome
from comparisons.experiments.stability.harness.family import Family, Series, family
from comparisons.report.terminal import fitted
from comparisons.report.values import label, power_of_ten

# ---- sweep points added up: how far each contestant holds, and whether ours holds its range ------


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


COLUMNS = ("family", "series", "to", "cases", "failures", "worst", "ours", "Mitsuba", "others")


def summaries(found: Sequence[Found]) -> dict[str, list[SeriesSummary]]:
    """By the ids of families."""
    names = dict.fromkeys(f.family for f in found)
    return {name: summarise(family(name), found_of(found, name)) for name in names}


def cells(name: str, one: SeriesSummary) -> list[str]:
    """Of one series, as text."""
    ours = total(one.found, OURS)
    others = [c for c in contestants(one.found) if c not in (OURS, MITSUBA)]
    shown: dict[str, list[str]] = {}
    for c in others:
        shown.setdefault(where(one, c), []).append(named(c))
    return [
        f"{name} {family(name).name}",
        label(one.series.name),
        f"{one.series.axis} {number(one.last)}" if one.series.axis else "",
        f"{ours.cases:,}" if ours else "–",
        f"{ours.failures:,}" if ours else "not measured",
        worst(one, OURS),
        where(one, OURS),
        where(one, MITSUBA),
        "; ".join(f"{', '.join(names)}: {found}" for found, names in shown.items()),
    ]


def where(one: SeriesSummary, contestant: str) -> str:
    """At which x a contestant starts to fail; of ours whether that is where float64 ends."""
    some = total(one.found, contestant)
    if some is None:
        return "–"
    if not some.failures:
        return "holds"
    share = f"{some.failures:,} of {some.cases:,}"
    x = first_failure(one.found, contestant)
    assert x is not None
    if contestant == OURS and one.holds:
        return f"holds to float64's end, {number(one.series.holds_to)}"
    return f"fails from {number(x)} on" if one.series.axis else share


def worst(one: SeriesSummary, contestant: str) -> str:
    """The largest error, with its unit."""
    some = total(one.found, contestant)
    if some is None or some.worst is None:
        return "–"
    return f"{number(some.worst)} {one.series.unit}".rstrip()


def number(value: float) -> str:
    """Two digits, powers of ten as such."""
    if value == 0.0 or math.isinf(value):
        return "0" if value == 0.0 else "∞"
    if 1e-3 <= value < 1e4:
        return f"{value:.2g}" if value < 100.0 else f"{value:,.0f}"
    return power_of_ten(value)


def terminal(found: Sequence[Found], width: int) -> RenderableType:
    """For people at a terminal of so many columns."""
    names = [name for name in COLUMNS if name != "failures"]  # the others say where each fails
    rows, styles = [], []
    for name, series in summaries(found).items():
        for one in series:
            _, series_name, to, cases, _, *rest = cells(name, one)
            rows.append((f"{name} {series_name}", to, cases, *rest))
            styles.append(None if one.holds else "bold red")
    return fitted(width, names[1:], rows, styles=styles, right=("cases",))


def markdown(
    found: Sequence[Found], effort: Effort, seed: int, provenance: Mapping[str, Any]
) -> str:
    """The table with its date and machine, for docs/results/stability.md."""
    shown = [
        f"`reference-rt stability --{effort} --seed {seed}`",
        str(provenance["date"])[:10],
        str(provenance["machine"]),
        f"{provenance['cores']} cores",
        f"Mitsuba {provenance.get('mitsuba', 'absent')}".partition(":")[0],
        f"{sum(f.seconds for f in found) / 60.0:.0f} minutes of one process",
    ]
    lines = ["Measured: " + ", ".join(shown) + ".", ""]
    lines += ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    for name, series in summaries(found).items():
        for one in series:
            row = [cell.replace("|", "\\|") for cell in cells(name, one)]
            lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"
