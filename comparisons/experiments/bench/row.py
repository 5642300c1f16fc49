"""A row of the table: a number of ours, a peer's, and the goal of their ratio."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from comparisons.experiments.bench.timing import Spread, ratios, spread
from comparisons.results.files import plain

Better = Literal["lower", "higher"]

LIMIT = "the limit"
"""The peer's name in a row that compares with a fixed limit; the goal is a ratio of 1."""


@dataclass(frozen=True)
class Row:
    """ours, peer: medians, in `unit`;  ratio: the median of ours / peer;  goal: the largest ratio
    that is good enough, or the smallest if higher is better;  spread: quartiles [low, high] of
    "ours", "peer" and "ratio", as far as measured;  details: further numbers."""

    name: str
    title: str
    ours: float
    peer: float
    peer_name: str
    unit: str
    ratio: float
    goal: float
    better: Better
    spread: dict[str, list[float]] = field(default_factory=dict)
    details: dict[str, Any] = field(default_factory=dict)

    @property
    def met(self) -> bool:
        """Whether the ratio meets the goal; NaN does not."""
        return self.ratio <= self.goal if self.better == "lower" else self.ratio >= self.goal

    def as_json(self) -> dict[str, Any]:
        """Strict JSON: numbers that are not finite are null."""
        document: dict[str, Any] = plain(asdict(self) | {"met": self.met})
        return document


def against(
    name: str,
    title: str,
    ours: Sequence[float],
    peer: tuple[str, Sequence[float]],
    goal: float,
    *,
    unit: str = "s",
    better: Better = "lower",
    details: dict[str, Any] | None = None,
) -> Row:
    """The row of numbers (rounds,) of ours and of a named peer, which took turns."""
    peer_name, theirs = peer
    mine, other, ratio = spread(ours), spread(theirs), ratios(ours, theirs)
    found = {"ours": mine, "peer": other, "ratio": ratio}
    return Row(
        name,
        title,
        mine.median,
        other.median,
        peer_name,
        unit,
        ratio.median,
        goal,
        better,
        {key: _around(value) for key, value in found.items()},
        {"rounds": len(ours), **(details or {})},
    )


def within(
    name: str,
    title: str,
    ours: Sequence[float],
    limit: float,
    *,
    unit: str = "s",
    details: dict[str, Any] | None = None,
) -> Row:
    """The row of numbers (rounds,) that must not exceed a limit."""
    mine = spread(ours)
    around = {"ours": _around(mine), "ratio": [x / limit for x in _around(mine)]}
    more = {"rounds": len(ours), **(details or {})}
    ratio = mine.median / limit
    return Row(name, title, mine.median, limit, LIMIT, unit, ratio, 1.0, "lower", around, more)


def row_from(document: dict[str, Any]) -> Row:
    """The row that `Row.as_json` wrote.  Raises TypeError for another document."""
    fields = {key: value for key, value in document.items() if key != "met"}
    missing = {k: math.nan for k in ("ours", "peer", "ratio") if fields.get(k) is None}
    around = {
        key: [math.nan if x is None else x for x in values]
        for key, values in fields.get("spread", {}).items()
    }
    return Row(**fields | missing | {"spread": around})


def _around(found: Spread) -> list[float]:
    return [found.low, found.high]
