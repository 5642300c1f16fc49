"""Compares reference_rt with Mitsuba 3: translation, the rungs of comparison, verdicts, reports.

    import comparisons

    case = comparisons.compare("scenes/cornell_box.yaml", size=(64, 64))
    print(case.verdict, case.reason)
    case.write_page("report.html")

`compare` takes a scene or a scene file; see `comparisons.compare.one_scene.compare_one`.

    case = comparisons.gate(pictures, scene="scenes/cornell_box.yaml")

`gate` takes the pictures of another renderer, and needs no Mitsuba; see
`comparisons.gate.request.gate`.

    case = comparisons.gate_derivative(derivatives, primal=my_picture, at=0.5)

`gate_derivative` takes derivatives of pictures; see `comparisons.gate.derivative`.

    checks = comparisons.testing.check_material(evaluate, sample, pdf)

`testing` takes functions of a material, or of a sampler; see `comparisons.gate.material`.

    case = comparisons.gate_pair(pictures_a, pictures_b)

`gate_pair` takes the pictures of two renderers, or of two back ends of one; see
`comparisons.gate.pair`.
"""

import importlib
from typing import Any


def __getattr__(name: str) -> Any:
    """Import what is named when it is first used: importing Mitsuba takes a second."""
    if name in ("gate_derivative", "gate_pair"):
        module = importlib.import_module(f"comparisons.gate.{name.removeprefix('gate_')}")
        return getattr(module, name)
    if name not in ("compare", "gate", "testing"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module(f"comparisons.{name}")


def __dir__() -> list[str]:
    """The public names, whether or not they have been used."""
    return sorted({*globals(), "compare", "gate", "gate_derivative", "gate_pair", "testing"})
