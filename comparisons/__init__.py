"""Compares reference_rt with Mitsuba 3: translation, the rungs of comparison, verdicts, reports.

    import comparisons

    case = comparisons.compare("scenes/cornell_box.yaml", size=(64, 64))
    print(case.verdict, case.reason)
    case.write_page("report.html")

`compare` takes a scene or a scene file; see `comparisons.compare.one_scene.compare_one`.
"""

import importlib
from typing import Any


def __getattr__(name: str) -> Any:
    """Import `compare` when it is first used: importing Mitsuba takes a second."""
    if name != "compare":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module("comparisons.compare")
