"""All families, in order.

To add one: a folder beside `harness` whose `family.py` states its law, ranges, counts and what
passes at its top and defines a `Family`, and a line here.
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
    module = importlib.import_module(f"comparisons.experiments.stability.{MODULES[name]}.family")
    return cast(Family, module.FAMILY)
