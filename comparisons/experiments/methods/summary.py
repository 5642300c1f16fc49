"""Rows grouped by method, series and family, and their totals."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from comparisons.experiments.methods.errors import share_interval
from comparisons.experiments.methods.run import Row


@dataclass(frozen=True)
class Total:
    """A method in several settings.

    ns: geometric mean of nanoseconds per ray;  worst: error in u (|t| + size / |d|), without
    relative series;  decided, wrong: numbers of rays;  surely_wrong: wrong ones that are not ties.
    """

    settings: int
    ns: float
    worst: float | None
    wrong: int
    surely_wrong: int
    decided: int

    @property
    def share(self) -> float:
        """The fraction of wrong answers, without ties."""
        return self.surely_wrong / self.decided if self.decided else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % confidence interval of `share`."""
        return share_interval(self.surely_wrong, self.decided)


def total(rows: Iterable[Row]) -> Total | None:
    """The total of some rows of one method; None for no rows."""
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
    return _unique(rows, "method")


def _unique(rows: Sequence[Row], name: str) -> list[str]:
    """The values of a field, in the order of their first appearance."""
    return list(dict.fromkeys(getattr(row, name) for row in rows))


def series_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of one family by series."""
    return {name: [r for r in rows if r.series == name] for name in _unique(rows, "series")}


def families_of(rows: Sequence[Row]) -> dict[str, list[Row]]:
    return {name: [r for r in rows if r.family == name] for name in _unique(rows, "family")}


def of_method(rows: Sequence[Row], method: str) -> list[Row]:
    return [row for row in rows if row.method == method]


def short(method: str) -> str:
    """A method's name for people, without its family: "Möller-Trumbore"."""
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
