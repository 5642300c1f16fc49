"""Rows added up: a method at ordinary and at extreme settings, and a series from end to end."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from comparisons.experiments.methods.errors import share_interval
from comparisons.experiments.methods.run import Row


@dataclass(frozen=True)
class Total:
    """A method in several settings.

    ns: the geometric mean;  worst: error in u (|t| + size / |d|), of series that are not relative;
    wrong, decided: rays;  surely_wrong: less those that are ties.
    """

    settings: int
    ns: float
    worst: float | None
    wrong: int
    surely_wrong: int
    decided: int

    @property
    def share(self) -> float:
        """Of wrong answers that are no ties."""
        return self.surely_wrong / self.decided if self.decided else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Of that share, 95 %."""
        return share_interval(self.surely_wrong, self.decided)


def total(rows: Iterable[Row]) -> Total | None:
    """None of no rows."""
    rows = list(rows)
    if not rows:
        return None
    worst = [row.errors.worst for row in rows if row.errors.worst is not None and not row.relative]
    return Total(
        len(rows),
        float(np.exp(np.mean([np.log(row.time.median) for row in rows]))),
        max(worst, default=None),
        sum(row.errors.wrong for row in rows),
        sum(row.errors.wrong - row.errors.ties for row in rows),
        sum(row.errors.decided for row in rows),
    )


def methods_of(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row.method for row in rows))


def series_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of one family by series."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.series, []).append(row)
    return found


def families_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.family, []).append(row)
    return found


def of_method(rows: Sequence[Row], method: str) -> list[Row]:
    return [row for row in rows if row.method == method]


def short(method: str) -> str:
    """Without the family: "robust"."""
    name = method.partition(".")[2]
    return _SPELT.get(name, name.replace("_", " "))


_SPELT = {
    "cramer": "Cramer",
    "even_odd": "even-odd",
    "lu": "LU",
    "moller_trumbore": "Möller-Trumbore",
    "sah": "SAH",
    "slabs_ieee": "IEEE slabs",
    "slabs_parallel_test": "slabs",
}
