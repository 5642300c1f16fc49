"""Settings of the families of stability, measured in this process."""

from collections.abc import Mapping
from pathlib import Path

from comparisons.experiments.stability.harness.outcomes import Outcome
from comparisons.experiments.stability.harness.series import Draw, family, generator


def measured(
    name: str,
    series: str,
    x: float,
    folder: Path,
    cases: int = 0,
    *,
    mitsuba: bool = False,
    full: bool = False,
    seed: int = 1,
) -> Mapping[str, Outcome]:
    """Of all contestants.  cases: by default those of the quick run;  full: with the effort of the
    full run."""
    one = family(name).by_name[series]
    rng = generator(seed, name, series, x)
    draw = Draw(rng, cases or one.cases["quick"], mitsuba, folder, "full" if full else "quick")
    return one.measure(draw, x)
