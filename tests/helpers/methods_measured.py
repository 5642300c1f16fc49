"""Settings of `reference-rt methods`, measured with a small effort."""

from comparisons.experiments.methods.run import FAMILIES, Effort, measure_setting

SMALL = Effort(rays=2048, checked=512, runs=3)
SEED = 3


def series(family, name):
    (found,) = (s for s in FAMILIES[family].series if s.name == name)
    return found


def measured(family, name, x, effort=SMALL, seed=SEED):
    """By method without its family."""
    rows = measure_setting(FAMILIES[family], series(family, name), x, effort, seed)
    return {row.method.partition(".")[2]: row for row in rows}


def surely_wrong(row):
    return row.errors.wrong - row.errors.ties
