"""Sentences that summarise the measured numbers."""

from collections.abc import Sequence

import numpy as np

from comparisons.experiments.methods.errors import share_interval
from comparisons.experiments.methods.run import Row
from comparisons.experiments.methods.summary import methods_of, of_method, series_of, short
from comparisons.report.values import power_of_ten

QUIET = 10.0
"""A series whose worst errors are below this, in u, gets no sentence and no plot about them."""

GROWS = 0.2
"""The smallest exponent of an error's growth that is reported: less is no growth over 8 decades."""

FEW = 0.1
"""The share of wrong answers up to which the growth of errors is fitted: beyond it, the hits with
the largest errors are missing."""

SLOWER = 3.0
"""The ratio of the slowest to the fastest setting from which a series' times are reported."""

CHEAPER = 1.05
"""The ratio of two times below which they count as equal."""


def nanoseconds(value: float) -> str:
    """A time with three digits; without a unit it is nanoseconds."""
    if value >= 1e6:
        return f"{value / 1e6:.3g} ms"
    if value >= 1e4:
        return f"{value / 1e3:.3g} µs"
    return f"{value:.3g}" if value < 1000.0 else f"{value:,.0f}"


def units(value: float | None) -> str:
    """An error in u."""
    if value is None:
        return "–"
    if value >= 1e4:
        return power_of_ten(value)
    return f"{value:.2g}" if value < 100.0 else f"{value:,.0f}"


def percent(share: float) -> str:
    if share == 0.0:
        return "0"
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.3g} %"


def sentences(rows: Sequence[Row]) -> list[str]:
    """About one family."""
    return [_costs(rows), *(_series(name, some) for name, some in series_of(rows).items())]


def _costs(rows: Sequence[Row]) -> str:
    """Of the first setting, the most ordinary one."""
    first = [r for r in rows if (r.series, r.x) == (rows[0].series, rows[0].x)]
    ranked = sorted(first, key=lambda row: row.time.median)
    fastest = ranked[0].time.median
    parts = []
    for row in ranked:
        ratio = row.time.median / fastest
        times = "" if ratio < CHEAPER else f" ({ratio:.2g} times)"
        parts.append(f"{short(row.method)} {with_unit(row.time.median)}{times}")
    hits = first[0].errors.hits / first[0].errors.checked
    where = f"{rows[0].axis} {_x(rows[0].x)}" if rows[0].axis else rows[0].series
    return (
        f"Time per ray at an ordinary setting ({where}; {percent(hits)} hit): {', '.join(parts)}."
    )


def with_unit(ns: float) -> str:
    """`nanoseconds`, always with a unit."""
    text = nanoseconds(ns)
    return text if text.endswith("s") else text + " ns"


def _series(name: str, rows: Sequence[Row]) -> str:
    said = [_decisions(rows), _errors(rows), _times(rows), _builds(rows)]
    return f"{name.capitalize()}: " + "; ".join(part for part in said if part) + "."


def _decisions(rows: Sequence[Row]) -> str:
    """Which methods answer wrongly, from which x on, and how often at worst; which never do."""
    wrong, never, only_ties = [], [], []
    for method in methods_of(rows):
        some = of_method(rows, method)
        surely = [row for row in some if row.errors.wrong > row.errors.ties]
        if surely:
            worst = max(surely, key=_sure_share)
            k, n = worst.errors.wrong - worst.errors.ties, worst.errors.decided
            low, high = (100.0 * end for end in share_interval(k, n))
            where = f" from {_x(surely[0].x)} on" if worst.axis and len(surely) > 1 else ""
            at = f" at {_x(worst.x)}" if worst.axis else ""
            wrong.append(
                f"{short(method)} is wrong{where}, {percent(k / n)}{at} [{low:.2g}, {high:.2g} %]"
            )
        elif any(row.errors.ties for row in some):
            only_ties.append(short(method))
        else:
            never.append(short(method))
    decided = sum(row.errors.decided for row in of_method(rows, rows[0].method))
    if not wrong and not only_ties:
        return f"no method is wrong for any of {decided:,} rays"
    if only_ties:
        wrong.append(f"{_list(only_ties)} only at ties")
    if never:
        wrong.append(f"{_list(never)} never, in {decided:,} rays")
    return ", ".join(wrong)


def _sure_share(row: Row) -> float:
    return (row.errors.wrong - row.errors.ties) / max(row.errors.decided, 1)


def _errors(rows: Sequence[Row]) -> str:
    """Median errors at the last setting of the series, and how they grow with x."""
    said, growing = [], []
    for method in methods_of(rows):
        some = [row for row in of_method(rows, method) if row.errors.median]
        if not some:
            continue
        said.append((some[-1].errors.median or 0.0, short(method)))
        power = _growth(some)
        if power is not None and power > GROWS:
            growing.append(f"{short(method)} {_law(power)}")
    if not said:
        return ""
    worst = max(row.errors.worst or 0.0 for row in rows)
    if worst <= QUIET:
        return f"no error is above {units(worst)} u"
    values = [value for value, _ in said]
    end = f" at {_x(rows[-1].x)}" if rows[0].axis else ""
    if max(values) < 2.0 * min(values):
        text = f"the median error{end} is {units(float(np.median(values)))} u for all"
    else:
        text = f"median errors{end}: " + ", ".join(f"{m} {units(v)} u" for v, m in sorted(said))
    return text + (f"; growth with x: {_list(growing)}" if growing else "")


def _growth(rows: Sequence[Row]) -> float | None:
    """The exponent of the median error as a power of x, over settings with few wrong answers."""
    fit = [row for row in rows if row.errors.share < FEW and row.errors.median]
    if len(fit) < 3 or not fit[0].axis:
        return None
    return _power([row.x for row in fit], [row.errors.median or 1.0 for row in fit])


def _law(power: float) -> str:
    """The growth with x in words, the exponent to a tenth."""
    rounded = round(power, 1)
    return {0.5: "as √x", 1.0: "as x", 2.0: "as x²"}.get(rounded, f"as x^{rounded:g}")


def _power(x: Sequence[float], y: Sequence[float]) -> float:
    """k of the best fit y = c x^k."""
    return float(np.polyfit(np.log10(x), np.log10(y), 1)[0])


def _times(rows: Sequence[Row]) -> str:
    """Times of the methods that depend strongly on x."""
    said = []
    for method in methods_of(rows):
        some = of_method(rows, method)
        times = [row.time.median for row in some]
        if some[0].axis and max(times) > SLOWER * min(times):
            power = _power([row.x for row in some], times)
            said.append(
                f"{short(method)} {with_unit(times[0])} to {with_unit(times[-1])} ({_law(power)})"
            )
    return f"time from the first to the last setting: {', '.join(said)}" if said else ""


def _builds(rows: Sequence[Row]) -> str:
    """Of acceleration structures: build times at the last setting, and whether all agree."""
    last = [row for row in rows if row.x == rows[-1].x and row.build is not None]
    if not last:
        return ""
    built = ", ".join(f"{short(row.method)} {1e3 * (row.build or 0.0):.3g} ms" for row in last)
    differs = sum(row.differs for row in rows)
    same = "all give the same t, bit for bit" if differs == 0 else f"{differs} t differ"
    return f"{same}; build times at {_x(rows[-1].x)}: {built}"


def _x(value: float) -> str:
    return power_of_ten(value) if value >= 1e4 else f"{value:.4g}"


def _list(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
