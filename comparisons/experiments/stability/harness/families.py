"""All families, in order.

To add one: a module beside `harness`, or a folder, that states its law, ranges, counts and what
passes at its top and defines a `FAMILY`, and a line here.
"""

import importlib
from typing import cast

from comparisons.experiments.stability.harness.family import Family

MODULES = {
    "F1": "far",
    "F2": "leaving",
    "F3": "watertight",
    "F4": "slivers",
    "F5": "hierarchy",
    "F6": "hostile",
    "F7": "solids",
    "F8": "roots",
    "F9": "metamorphic",
    "F10": "furnaces",
    "F11": "bsdfs",
    "F12": "radiometry",
    "F13": "contact",
    "F14": "determinism",
}


def family(name: str) -> Family:
    """The `FAMILY` of its module, which is imported only when it is needed."""
    module = importlib.import_module(f"comparisons.experiments.stability.{MODULES[name]}")
    return cast(Family, module.FAMILY)
