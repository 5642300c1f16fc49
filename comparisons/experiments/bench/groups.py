"""All groups of rows, in the order of the table.

To add a row: its name and the function that measures it here; the function in a file of its own.
"""

from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

from comparisons.experiments.bench import equal_error, equal_samples, mesh_rays, program
from comparisons.experiments.bench.row import Row
from comparisons.experiments.bench.setting import Setting
from reference_rt.util.errors import UsageError


class Group(NamedTuple):
    """Rows that one function measures together."""

    name: str
    rows: tuple[str, ...]
    measure: Callable[[Setting], list[Row]]


GROUPS = (
    Group("equal_samples", tuple(equal_samples.VARIANTS), equal_samples.measure),
    Group(
        "equal_error",
        ("error_default", "error_default_worst", "error_best"),
        equal_error.measure,
    ),
    Group(
        "mesh_rays", (*(f"rays_{kind}" for kind in mesh_rays.GOALS), "any_hit"), mesh_rays.measure
    ),
    Group("threads", ("threads",), equal_samples.measure_threads),
    Group("cold", ("cold", "cold_median"), program.measure_ever),
    Group("new_kind", ("new_kind", "new_kind_median"), program.measure_new),
    Group("warm_up", ("warm_up", "after_warm_up"), program.measure_warmed),
    Group("smoke", ("smoke",), program.measure_smoke),
    Group("warm", ("warm",), program.measure_warm),
)


def chosen(patterns: Sequence[str]) -> tuple[Group, ...]:
    """The groups with a row that matches one of these shell patterns; all groups if there are no
    patterns.  Raises UsageError for a pattern that matches no row."""
    for pattern in patterns:
        if not any(fnmatchcase(row, pattern) for group in GROUPS for row in group.rows):
            known = ", ".join(row for group in GROUPS for row in group.rows)
            raise UsageError(f"--only: no row has the name '{pattern}'; expected some of {known}")
    return tuple(
        group
        for group in GROUPS
        if not patterns
        or any(fnmatchcase(row, pattern) for row in group.rows for pattern in patterns)
    )
