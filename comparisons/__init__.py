"""Compares reference_rt with Mitsuba 3: translation, the rungs of comparison, verdicts, reports.

    import comparisons

    case = comparisons.compare("scenes/cornell_box.yaml", size=(64, 64))
    print(case.verdict, case.reason)
    case.write_page("report.html")

`compare` takes a scene or a scene file; see `comparisons.compare.one_scene.compare_one`.

    case = comparisons.gate(pictures, scene="scenes/cornell_box.yaml")

`gate` takes the pictures of another renderer, and needs no Mitsuba; see
`comparisons.gate.request.gate`.
"""

import importlib
from typing import Any


def __getattr__(name: str) -> Any:
    """Import `compare` and `gate` when they are first used: importing Mitsuba takes a second."""
    if name not in ("compare", "gate"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module(f"comparisons.{name}")
